#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What tools/demo shows. Usage: demo.py PROGRAM FOLDER"""
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGE = "python3-pcl"  # its examples hold real scans; it is unpacked, not installed
EXAMPLES = "usr/share/doc/python3-pcl/examples/pcldata/tutorials"
SCANS = [("table_scene_lms400.pcd", "a table, SICK LMS400 laser, 460,400 points"),
         ("correspondence_grouping/milk_cartoon_all_small_clorox.pcd", "a table with cartons, Kinect, coloured")]
PROMISES = [("rms 10 mm (default)", []), ("each axis 2 mm", ["--max-error", "0.002"]), ("lossless", ["--lossless"])]
HEADER = f"{'promise':<20}{'bytes':>11}{'ratio':>8}{'bits/pt':>8}{'RMS mm':>8}{'max mm':>8}{'colour':>7}{'s in/out':>10}"


def fetch(folder):
    """The scans, from the Debian archive. Does nothing when they are there."""
    if all((folder / EXAMPLES / name).exists() for name, _ in SCANS):
        return
    done = subprocess.run(["apt-get", "download", PACKAGE], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:  # a fresh machine has no package lists yet
        root = [] if os.geteuid() == 0 else ["sudo"]
        subprocess.run([*root, "apt-get", "update", "-qq"], check=True, stdout=sys.stderr)
        subprocess.run(["apt-get", "download", PACKAGE], cwd=folder, check=True, capture_output=True)
    archive = sorted(folder.glob(PACKAGE + "_*.deb"))[-1]
    unpacked = folder / "unpacking"
    shutil.rmtree(unpacked, ignore_errors=True)
    subprocess.run(["dpkg", "-x", archive, unpacked], check=True)
    shutil.rmtree(folder / "usr", ignore_errors=True)
    (unpacked / "usr").rename(folder / "usr")
    shutil.rmtree(unpacked)


class Demo:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder
        self.notes = {}  # what the program said aloud, each once

    def run(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"demo: {' '.join(map(str, arguments))} ended with {done.returncode}\n{done.stderr}")
        self.notes.update(dict.fromkeys(done.stderr.splitlines()))
        return done.stdout

    def json(self, *arguments):
        return json.loads(self.run(*arguments, "--json"))

    def compress(self, source, name, flags):
        archive, decoded = self.folder / f"{name}.mapc", self.folder / f"{name}.pcd"
        made = self.json("compress", source, "-o", archive, "--force", "--progress", "none", *flags)
        got = self.json("decompress", archive, "-o", decoded, "--force", "--progress", "none")
        self.run("verify", archive, "--against", source)
        measured = self.json("evaluate", source, archive)
        return archive, made, got, measured

    def row(self, label, made, got, measured):
        colour = measured["color_error"]
        print(f"{label:<20}{made['bytes']:>11,}{made['ratio']:>8.4f}{made['bits_per_point']:>8.3f}"
              f"{1e3 * measured['rms_m']:>8.3f}{1e3 * measured['max_axis_error_m']:>8.3f}"
              f"{'-' if colour is None or not self.coloured(made) else format(colour, '.2f'):>7}"
              f"{made['encode_seconds']:>5.1f}{got['decode_seconds']:>5.2f}", flush=True)

    @staticmethod
    def coloured(made):
        return any(c["name"] == "rgb" for c in made["channels"])

    def box(self, archive, made):
        """The cube of half the width around the middle."""
        lo, hi = made["bounds"]["min"], made["bounds"]["max"]
        corners = [f"{(3 * a + b) / 4:.3f}" for a, b in zip(lo, hi)] + [f"{(a + 3 * b) / 4:.3f}" for a, b in zip(lo, hi)]
        out = self.folder / "box.pcd"
        got = self.json("decompress", archive, "-o", out, "--force", "--progress", "none", "--box", ",".join(corners))
        print(f"box      the middle half of each side: {got['points']:,} points from {got['tiles_read']} of {made['tiles']} tiles,\n"
              f"         {got['bytes_read']:,} bytes read, first point after {1e3 * got['first_point_seconds']:.1f} ms")

    def scan(self, source, text):
        print(f"\n{source.name}: {text}\n{source.stat().st_size:,} bytes as PCD\n\n{HEADER}", flush=True)
        stem = source.stem
        for number, (label, flags) in enumerate(PROMISES):
            archive, made, got, measured = self.compress(source, f"{stem}-{number}", flags)
            self.row(label, made, got, measured)
            if number == 0:
                shown = archive
            if number == 1:
                boxed = archive, made
        print("".join(f"\n{note}" for note in self.notes))
        self.notes.clear()
        print("verify   every promise measured against the original: kept")
        self.box(*boxed)
        picture = self.folder / f"{stem}.png"
        self.run("render", source, shown, "-o", picture)
        print(f"picture  {picture} (original, decoded at the default)")
        print(f"archive  {boxed[0]}", flush=True)


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    fetch(folder)
    demo = Demo(program, folder)
    print("ratio: archive to 12 bytes per point plus its channels; max: along one axis;\ncolour: mean RGB distance, 0 to 255")
    for name, text in SCANS:
        demo.scan(folder / EXAMPLES / name, text)


if __name__ == "__main__":
    main()
