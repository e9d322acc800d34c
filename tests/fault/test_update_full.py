# SPDX-License-Identifier: GPL-3.0-or-later
"""update and compact on a disk that is full at random places, and readers in other processes while files are swapped.

MAPCODEC_FAULT_FULL: how often the disk is full (default 20).
"""
import os
import random
import resource
import unittest

from clouds import pcd_bytes, room, write
from program import CANNOT_WRITE, DONE, ProgramTest, run, start


def limited(size):
    """A writer's limit stands in for a full disk: write() fails in the same place."""
    return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)), "restore_signals": False}


class FullDisk(ProgramTest):
    def setUp(self):
        super().setUp()
        self.scans = [write(self.path(f"{i}.pcd"), pcd_bytes(room(4000, seed=i, offset=(3 * i, 0, 0)))) for i in range(5)]
        self.map = self.path("map.mapc")
        self.succeeds("update", self.map, self.scans[0], "--create", "--rms", 0.02)

    def state(self):
        info = self.succeeds("info", self.map, "--json").json
        return info["revision"], info["points"], info["tiles"]

    def test_what_was_committed_stays(self):
        r = random.Random(8)
        full = {"update": 0, "compact": 0}
        for i in range(int(os.environ.get("MAPCODEC_FAULT_FULL", "20"))):
            before, listing = self.state(), self.listing()
            size = self.map.stat().st_size
            verb = "compact" if i % 4 == 3 else "update"
            work = ("compact", self.map) if verb == "compact" else ("update", self.map, self.scans[i % 5], "--all-points")
            # An update grows the file; a compaction writes it anew.
            room_left = r.randrange(0, 60000)
            outcome = run(*work, **limited(r.randrange(1, size) if verb == "compact" else size + room_left))
            self.assertIn(outcome.code, (DONE, CANNOT_WRITE), f"{work} {i}: {outcome}")
            self.succeeds("verify", self.map)
            if outcome.code == DONE:
                continue
            full[verb] += 1
            self.one_error_line(outcome, names=self.map)
            self.assertEqual(self.state(), before)
            self.assertEqual(self.listing(), listing)
            if i % 5 == 0:  # there is room again
                self.succeeds("update", self.map, self.scans[i % 5], "--all-points")
                self.assertGreater(self.state()[1], before[1])
            if before[1] > 200000:
                self.succeeds("remove", self.map, "--box", "-99,-99,-99,99,99,0.5")
        self.assertGreater(full["update"], 0)
        self.assertGreater(full["compact"], 0)

    def test_readers_see_whole_revisions_while_files_are_swapped(self):
        counts = {self.state()[1]}
        readers = []
        for i in range(6):
            readers += [start("decompress", self.map, "-o", self.path(f"out{i}-{k}.pcd"), "--progress", "none") for k in range(2)]
            self.succeeds("update", self.map, self.scans[1 + i % 4], "--all-points")
            counts.add(self.state()[1])
            readers.append(start("verify", self.map))
            self.succeeds("compact", self.map)
            counts.add(self.state()[1])
        for reader in readers:
            out, err = reader.communicate()
            self.assertEqual(reader.returncode, DONE, err)
        for out in self.folder.glob("out*.pcd"):
            head = out.read_bytes()[:400].decode(errors="replace")
            self.assertIn(int(head.split("POINTS ")[1].split()[0]), counts)


if __name__ == "__main__":
    unittest.main()
