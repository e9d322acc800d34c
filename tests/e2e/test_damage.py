# SPDX-License-Identifier: GPL-3.0-or-later
"""Archives that were cut or changed: an error, or the same content; never a crash, never silence."""
import os
import random
import unittest
from concurrent.futures import ThreadPoolExecutor

from clouds import pcd_bytes, room, write
from program import BAD_INPUT, DAMAGED, ProgramTest, run

CUTS, FLIPS = 100, 1000
MAGIC_BYTES = 16  # where the damage falls on the signature, the file may count as no archive at all


class Damage(ProgramTest):
    def setUp(self):
        super().setUp()
        source = write(self.path("in.pcd"), pcd_bytes(room(2500)))
        self.archives = [(flags, self.compress(source, *flags, "--tile-size", 2.5, name=f"{n}.mapc").read_bytes())
                         for n, flags in enumerate((("--max-error", 0.01), ("--lossless",), ("--paper",)))]

    def content(self, data, name):
        """(exit code of verify, exit code of decompress, decoded bytes or None)."""
        archive = write(self.path(name + ".mapc"), data)
        out = self.path(name + ".pcd")
        verify = run("verify", archive)
        decode = run("decompress", archive, "-o", out, "--threads", 1)
        decoded = out.read_bytes() if out.exists() else None
        for outcome in (verify, decode):
            if outcome.code != 0:
                self.one_error_line(outcome, names=archive)
        archive.unlink()
        out.unlink(missing_ok=True)
        return verify, decode, decoded

    def check(self, job):
        name, data, whole, early = job
        verify, decode, decoded = self.content(data, name)
        refused = (DAMAGED, BAD_INPUT) if early else (DAMAGED,)
        self.assertIn(verify.code, refused, f"{name}: verify must find it: {verify}")
        self.assertIn(decode.code, (0, *refused), f"{name}: {decode}")
        if decode.code == 0:
            self.assertEqual(decoded, whole, f"{name}: other content, and nothing was said")
        else:
            self.assertIsNone(decoded, f"{name}: a file was left behind")

    def check_all(self, jobs):
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(self.check, jobs))

    def each(self, make_jobs, count):
        share = count // len(self.archives) + 1
        for n, (flags, data) in enumerate(self.archives):
            verify, decode, whole = self.content(data, f"whole{n}")
            self.assertEqual((verify.code, decode.code), (0, 0), f"{flags}: {verify} {decode}")
            self.check_all(make_jobs(n, data, whole, share))

    def test_cut_at_100_places(self):
        def jobs(n, data, whole, share):
            lengths = sorted({len(data) * k // share for k in range(share)} | {len(data) - 1, len(data) - 9, 1, 8})
            return [(f"{n}cut{k}", data[:k], whole, k < 64) for k in lengths]
        self.each(jobs, CUTS)

    def test_1000_flipped_bytes(self):
        def jobs(n, data, whole, share):
            r = random.Random(n)
            for k in range(share):
                at = r.randrange(len(data))
                flipped = bytearray(data)
                flipped[at] ^= r.randrange(1, 256)
                yield f"{n}flip{k}at{at}", bytes(flipped), whole, at < MAGIC_BYTES
        self.each(jobs, FLIPS)

    def test_bytes_appended(self):
        # What a torn write leaves behind a whole commit: the commit still opens.
        _, data = self.archives[0]
        whole = self.content(data, "whole")[2]
        for tail in (b"\0", b"\0" * 100, os.urandom(3000), data[:200]):
            verify, decode, decoded = self.content(data + tail, "tail")
            self.assertIn(decode.code, (0, DAMAGED))
            if decode.code == 0:
                self.assertEqual(decoded, whole)
            self.assertIn(verify.code, (0, DAMAGED))

    def test_two_archives_mixed(self):
        (_, a), (_, b) = self.archives[:2]
        half = len(a) // 2
        verify, decode, decoded = self.content(a[:half] + b[half:], "mixed")
        self.assertEqual(verify.code, DAMAGED)


if __name__ == "__main__":
    unittest.main()
