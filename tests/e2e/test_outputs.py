# SPDX-License-Identifier: GPL-3.0-or-later
"""Places that cannot be written, and disks that are full."""
import os
import resource
import subprocess
import unittest

from clouds import RGB, pcd_bytes, room, write
from program import CANNOT_WRITE, USAGE, ProgramTest, run


class Outputs(ProgramTest):
    def setUp(self):
        super().setUp()
        self.source = write(self.path("in.pcd"), pcd_bytes(room(20000, RGB)))

    def test_places_that_cannot_be_written(self):
        (self.path("folder.mapc")).mkdir()
        (self.path("folder.pcd")).mkdir()
        archive = self.compress(self.source)
        before = self.listing()
        for place in (self.path("nowhere"), self.path("in.pcd"), "/proc"):  # no folder; a file; no writable file system
            self.fails(CANNOT_WRITE, "compress", self.source, "-o", f"{place}/x.mapc", names=place)
            self.fails(CANNOT_WRITE, "decompress", archive, "-o", f"{place}/x.pcd", names=place)
        self.fails(CANNOT_WRITE, "compress", self.source, "-o", self.path("folder.mapc"), "--force", names="folder.mapc")
        self.fails(CANNOT_WRITE, "decompress", archive, "-o", self.path("folder.pcd"), "--force", names="folder.pcd")
        self.assertEqual(self.listing(), before)

    def test_an_old_file_is_replaced_only_by_force(self):
        archive = self.compress(self.source, "--max-error", 0.01)
        old = archive.read_bytes()
        self.fails((USAGE, CANNOT_WRITE), "compress", self.source, "-o", archive, "--max-error", 0.02, names=archive, says="--force")
        self.assertEqual(archive.read_bytes(), old)
        self.succeeds("compress", self.source, "-o", archive, "--max-error", 0.02, "--force")
        self.assertNotEqual(archive.read_bytes(), old)

    def test_the_input_is_never_the_output(self):
        data = self.source.read_bytes()
        outcome = run("compress", self.source, "-o", self.source)
        self.assertNotEqual(outcome.code, 0)
        self.assertEqual(self.source.read_bytes(), data)

    def limited(self, limit):
        """A writer's limit stands in for a full disk: write() fails in the same place."""
        return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)), "restore_signals": False}

    def test_writes_that_fail_midway(self):
        archive = self.compress(self.source, "--max-error", 0.001)
        old = archive.read_bytes()
        before = self.listing()
        self.fails(CANNOT_WRITE, "compress", self.source, "-o", archive, "--max-error", 0.0005, "--force", names=archive, **self.limited(20000))
        self.fails(CANNOT_WRITE, "compress", self.source, "-o", self.path("new.mapc"), "--max-error", 0.0005, **self.limited(20000))
        self.fails(CANNOT_WRITE, "decompress", archive, "-o", self.path("new.pcd"), **self.limited(20000))
        self.assertEqual(archive.read_bytes(), old)
        self.assertEqual(self.listing(), before)

    def test_full_disk(self):
        disk = self.path("disk")
        disk.mkdir()
        mounted = os.geteuid() == 0 and subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(disk)], capture_output=True).returncode == 0
        if not mounted:
            self.skipTest("mounting a small file system needs root; test_writes_that_fail_midway stands in")
        self.addCleanup(subprocess.run, ["umount", str(disk)], check=False)
        archive = self.compress(self.source, "--max-error", 0.01, name="small.mapc")
        self.fails(CANNOT_WRITE, "compress", self.source, "-o", disk / "x.mapc", "--lossless", names=disk, says="space|full")
        self.fails(CANNOT_WRITE, "decompress", archive, "-o", disk / "x.pcd", names=disk, says="space|full")
        self.assertEqual(list(disk.iterdir()), [])

    def test_full_disk_for_spilled_points(self):
        big = write(self.path("big.pcd"), pcd_bytes(room(60000, RGB)))
        before = self.listing()
        self.fails(CANNOT_WRITE, "compress", big, "-o", self.path("new.mapc"), "--max-memory", "1M", "--tile-size", 1, "--lossless",
                   **self.limited(30000))
        self.assertEqual(self.listing(), before)


if __name__ == "__main__":
    unittest.main()
