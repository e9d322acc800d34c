#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""A rawlog becomes a map twice: in one go, and killed half way and begun again. Compares the maps and measures memory.

Usage: interrupted_rawlog.py MAPCODEC LOG FOLDER [FLAGS OF mapcodec rawlog...]
Prints JSON; exit code 1 if the maps differ. Memory is the sum of the peaks (VmHWM) of mapcodec and its reader.
"""
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path


def peak_of(pid):
    try:
        return int(re.search(r"VmHWM:\s+(\d+)", Path(f"/proc/{pid}/status").read_text()).group(1)) * 1024
    except (OSError, AttributeError):
        return 0


def children_of(pid):
    try:
        return [int(c) for c in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def run(program, log, out, flags, kill_at=None):
    """Runs once; kills at this share of the log. @return exit code, peak bytes, CPU seconds, share reached, stderr's notes"""
    before = os.times()
    p = subprocess.Popen([program, "rawlog", log, "-o", out, "--progress", "json", "--trajectory", out + ".tum", *flags],
                         stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    state = {"share": 0.0, "notes": []}

    def listen():
        for line in p.stderr:
            try:
                j = json.loads(line)
                state["share"] = j["done"] / max(1, j["total"])
            except (ValueError, KeyError):
                state["notes"].append(line.strip())

    thread = threading.Thread(target=listen)
    thread.start()
    own = reader = 0
    while p.poll() is None:
        own = max(own, peak_of(p.pid))
        for child in children_of(p.pid):
            reader = max(reader, peak_of(child))
        if kill_at is not None and state["share"] >= kill_at:
            p.send_signal(signal.SIGKILL)
        time.sleep(0.05)
    thread.join()
    after = os.times()
    return {"exit": p.returncode, "peak_bytes": own + reader, "peak_reader_bytes": reader,
            "cpu_s": round(after.children_user + after.children_system - before.children_user - before.children_system, 1),
            "killed_at": state["share"] if kill_at else None, "notes": state["notes"]}


def content(program, out):
    info = json.loads(subprocess.run([program, "info", out, "--json", "--tiles"], capture_output=True, text=True, check=True).stdout)
    return info["tile_list"], Path(out + ".tum").read_text(), info


def main():
    program, log, folder, *flags = sys.argv[1:]
    whole, parts = f"{folder}/whole.mapc", f"{folder}/parts.mapc"
    for old in (whole, parts):
        Path(old).unlink(missing_ok=True)
    result = {"log_bytes": os.path.getsize(log), "flags": flags, "whole": run(program, log, whole, flags)}
    result["killed"] = run(program, log, parts, flags, kill_at=0.5)
    result["resumed"] = run(program, log, parts, flags)
    a, b = content(program, whole), content(program, parts)
    result["same_tiles"], result["same_poses"] = a[0] == b[0], a[1] == b[1]
    result["map"] = {k: a[2][k] for k in ("points", "tiles", "bytes", "submaps", "bits_per_point")}
    print(json.dumps(result, indent=1))
    return 0 if result["same_tiles"] and result["same_poses"] else 1


if __name__ == "__main__":
    sys.exit(main())
