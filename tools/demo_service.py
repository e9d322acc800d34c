#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tools/demo --service shows: two robots write into one map, a third program follows and ends with the same bytes.
Usage: demo_service.py PROGRAM DAEMON FOLDER"""
import filecmp
import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import demo

SCAN = "table_scene_lms400.pcd"
SCANS_OF_A_ROBOT = 8


def points_of(path):
    """x, y, z of a binary PCD file of floats, packed."""
    data = path.read_bytes()
    head, body = data.split(b"DATA binary\n", 1)
    fields = {line.split()[0]: line.split()[1:] for line in head.decode().splitlines() if line and line[0] != "#"}
    stride = sum(int(size) * int(count) for size, count in zip(fields["SIZE"], fields["COUNT"]))
    return [body[i:i + 12] for i in range(0, stride * int(fields["POINTS"][0]), stride)]


def write_scan(path, points):
    head = (f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA binary\n")
    path.write_bytes(head.encode() + b"".join(points))


class ServiceDemo:
    def __init__(self, program, daemon, folder):
        self.program, self.daemon, self.folder = program, daemon, folder
        self.processes = []

    def start(self, *command, **options):
        process = subprocess.Popen([str(c) for c in command], stdin=subprocess.DEVNULL, **options)
        self.processes.append(process)
        return process

    def run(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"demo: {' '.join(map(str, arguments))} ended with {done.returncode}\n{done.stderr}")
        return done.stdout

    def json(self, *arguments):
        return json.loads(self.run(*arguments, "--json"))

    def start_daemon(self):
        ports = self.folder / "ports"
        process = self.start(self.daemon, "--data", self.folder / "maps", "--listen", "127.0.0.1:0", "--http", "127.0.0.1:0", "--port-file", ports,
                             stderr=(self.folder / "mapcodecd.log").open("w"))
        while not ports.exists():
            if process.poll() is not None:
                sys.exit("demo: mapcodecd does not start: " + (self.folder / "mapcodecd.log").read_text())
            time.sleep(0.02)
        return process, "mapcodecd", ports.read_text().split()[0]

    def write_scans(self, source):
        """Each robot saw half of the table, from its own place."""
        whole, plain = self.folder / "whole.mapc", self.folder / "whole.pcd"
        self.run("compress", source, "-o", whole, "--lossless", "--progress", "none")
        self.run("decompress", whole, "-o", plain, "--progress", "none")  # as binary
        points = points_of(plain)
        for robot in range(2):
            for k in range(SCANS_OF_A_ROBOT):
                write_scan(self.folder / f"robot{robot}-{k}.pcd", points[robot * SCANS_OF_A_ROBOT + k::2 * SCANS_OF_A_ROBOT])

    def robot(self, number, url):
        """A process of its own: one scan after the other into its own submap."""
        script = "set -e\n" + "".join(
            f"{self.program} update {url} {self.folder}/robot{number}-{k}.pcd --submap robot{number} "
            f"--pose {2.5 * number},0,0,0,0,{0.0 if number == 0 else 0.6},{1.0 if number == 0 else 0.8}\n"
            for k in range(SCANS_OF_A_ROBOT))
        return self.start("bash", "-c", script, stdout=subprocess.DEVNULL)

    def follower(self, url, copy):
        return self.start(self.program, "sync", url, copy, "--follow", "--json", stdout=(self.folder / "followed").open("w"))

    def followed(self):
        return [json.loads(line) for line in (self.folder / "followed").read_text().splitlines()]

    def wait_for(self, revision):
        for _ in range(600):
            if any(step["revision"] >= revision for step in self.followed()):
                return
            time.sleep(0.05)
        sys.exit("demo: the follower does not come to the last revision")

    def show(self, source):
        (self.folder / "maps").mkdir()
        self.write_scans(source)
        daemon, name, address = self.start_daemon()
        url = f"mapcodec://{address}/table"
        print(f"{name} serves {self.folder}/maps on {address}")
        self.run("update", url, self.folder / "robot0-0.pcd", "--create", "--max-error", "0.002")
        copy = self.folder / "copy.mapc"
        follower = self.follower(url, copy)
        robots = [self.robot(n, url) for n in range(2)]
        for robot in robots:
            if robot.wait() != 0:
                sys.exit("demo: a robot failed")
        there = self.json("info", url)
        self.wait_for(there["revision"])
        follower.send_signal(signal.SIGTERM)
        if follower.wait() != 0:
            sys.exit("demo: the follower failed")
        steps = self.followed()
        print(f"two robots put {2 * SCANS_OF_A_ROBOT} scans in, {there['points']:,} points in {there['tiles']} tiles of 2 submaps, "
              f"revision {there['revision']}")
        print(f"a follower took {len(steps)} steps, {sum(s['bytes_fetched'] for s in steps):,} bytes; the last step "
              f"{steps[-1]['bytes_fetched']:,} of the map's {steps[-1]['bytes_whole']:,}")
        self.run("verify", copy)
        mine = self.json("diff", copy, str(steps[-1]["revision"]), str(steps[-1]["revision"]))
        self.run("compact", url)
        last = self.json("sync", url, copy)
        self.run("compact", copy)
        daemon.send_signal(signal.SIGTERM)
        if daemon.wait() != 0:
            sys.exit("demo: mapcodecd did not end in order: " + (self.folder / "mapcodecd.log").read_text())
        same = filecmp.cmp(copy, self.folder / "maps/table.mapc", shallow=False)
        print(f"compacted on both sides, after {last['bytes_fetched']:,} bytes more: {copy.stat().st_size:,} bytes, "
              f"{'byte for byte the same' if same else 'NOT the same'}")
        print("mapcodecd ended in order")
        return 0 if same and mine is not None else 1

    def end(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
                process.wait()


def main():
    program, daemon, work = sys.argv[1], sys.argv[2], Path(sys.argv[3])
    demo.fetch(work)
    folder = work / "service"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    show = ServiceDemo(program, daemon, folder)
    try:
        return show.show(work / demo.EXAMPLES / SCAN)
    finally:
        show.end()


if __name__ == "__main__":
    sys.exit(main())
