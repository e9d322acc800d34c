# SPDX-License-Identifier: GPL-3.0-or-later
"""SIGINT, SIGTERM and kill -9 in the middle: no half file under the final name, the old one as it was."""
import random
import signal
import struct
import time
import unittest

from program import ProgramTest, killed_by_signal, run, start

DELAYS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)


def noise_pcd(count):
    """Points without any order, which take the longest to compress."""
    r = random.Random(5)
    head = (f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n").encode()
    return head + struct.pack(f"<{3 * count}f", *(r.random() * 50 for _ in range(3 * count)))


def listens(process, number):
    """Whether the program has come as far as to handle the signal: on a busy machine that takes its time."""
    with open(f"/proc/{process.pid}/status") as status:
        caught = next(line.split()[1] for line in status if line.startswith("SigCgt"))
    return int(caught, 16) >> (number - 1) & 1 == 1


class Interruption(ProgramTest):
    @classmethod
    def setUpClass(cls):
        cls.data = noise_pcd(400000)

    def setUp(self):
        super().setUp()
        self.source = self.path("in.pcd")
        self.source.write_bytes(self.data)

    def interrupt(self, number, delay, *arguments):
        """Sends the signal after `delay` (None: as soon as it will be handled); the exit code, stderr and whether the
        signal was to be handled; or None when the program was done before."""
        process = start(*arguments)
        if delay is not None:
            time.sleep(delay)
        while delay is None and process.poll() is None and not listens(process, number):
            time.sleep(0.002)
        done = process.poll() is not None
        heard = not done and listens(process, number)
        if not done:
            process.send_signal(number)
        _, err = process.communicate(timeout=120)
        return None if done else (process.returncode, err.decode(), heard)

    def gentle(self, *arguments, target, old):
        """SIGINT and SIGTERM: one line, an exit code, no file more than before."""
        before = self.listing()
        met = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            for delay in (*DELAYS, None):
                outcome = self.interrupt(number, delay, *arguments)
                if outcome is None or outcome[0] == 0:  # it was done, or past the point where it could stop
                    if old is None:
                        target.unlink()
                    else:
                        target.write_bytes(old)
                else:
                    code, err, heard = outcome
                    self.assertFalse(killed_by_signal(code), f"exit {code}: {err}")
                    if heard:
                        met += 1
                        self.assertGreater(code, 0, "the signal was not caught")
                        self.assertRegex(err, r"\Amapcodec: [^\n]+\n\Z")
                self.assertEqual(self.listing(), before, f"{number} after {delay} s: leftovers")
                if old is not None:
                    self.assertEqual(target.read_bytes(), old)
        self.assertGreater(met, 0, "the work is too short for this test")

    def test_compress_stops_on_a_signal(self):
        target = self.path("new.mapc")
        self.gentle("compress", self.source, "-o", target, "--max-error", 0.0005, "--effort", "high", target=target, old=None)

    def test_compress_out_of_core_stops_on_a_signal(self):
        target = self.path("new.mapc")
        self.gentle("compress", self.source, "-o", target, "--lossless", "--max-memory", "4M", target=target, old=None)

    def test_the_old_archive_stays(self):
        target = self.path("old.mapc")
        target.write_bytes(b"whatever was here")
        self.gentle("compress", self.source, "-o", target, "--max-error", 0.0005, "--effort", "high", "--force", target=target,
                    old=b"whatever was here")

    def test_decompress_leaves_no_half_file(self):
        archive = self.compress(self.source, "--max-error", 0.0005)
        target = self.path("out.pcd")
        for delay in DELAYS:
            self.interrupt(signal.SIGINT, delay, "decompress", archive, "-o", target, "--force", "--threads", 1)
            if target.exists():
                self.assertEqual(target.stat().st_size > 400000 * 12, True)
                target.unlink()
            self.assertEqual(self.listing(), ["in.pcd", "map.mapc"])

    def test_kill_leaves_the_old_archive_and_no_half_one(self):
        old = self.compress(self.source, "--max-error", 0.05, name="old.mapc")
        bytes_before = old.read_bytes()
        for delay in DELAYS:
            self.interrupt(signal.SIGKILL, delay, "compress", self.source, "-o", old, "--max-error", 0.0005, "--force")
            if old.read_bytes() != bytes_before:  # it was done in time
                self.assertEqual(run("verify", old).code, 0)
                old.write_bytes(bytes_before)
            new = self.path("new.mapc")
            self.interrupt(signal.SIGKILL, delay, "compress", self.source, "-o", new, "--max-error", 0.0005)
            if new.exists():
                self.assertEqual(run("verify", new).code, 0)
                new.unlink()
        self.succeeds("verify", old)
        self.succeeds("compress", self.source, "-o", self.path("new.mapc"), "--max-error", 0.05)  # leftovers do not disturb
        self.assertEqual(self.path("new.mapc").read_bytes(), bytes_before)
        self.succeeds("compress", self.source, "-o", old, "--max-error", 0.05, "--force")
        self.assertEqual(self.listing(), ["in.pcd", "new.mapc", "old.mapc"], "killed writers' temporaries stay")


if __name__ == "__main__":
    unittest.main()
