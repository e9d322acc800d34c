# SPDX-License-Identifier: GPL-3.0-or-later
"""Streams of tiles: the coarse level first, and readers that take their time."""
import random
import struct
import subprocess
import threading
import unittest
from pathlib import Path

from daemon import DaemonTest, fetch, insert, memory_factor, pb, rpc, scan, scan_of
from program import PROGRAM

COARSE = 4  # cells of tile_size / 8


def corrugated(count):
    """Points of a surface that has details at every level, packed float32."""
    rng = random.Random(5)
    values = []
    for _ in range(count):
        x, y = rng.uniform(0, 24), rng.uniform(0, 24)
        values += [x, y, 0.3 * ((x * 1.7) % 1) + 0.1 * ((y * 5.3) % 1) + rng.gauss(0, 0.004)]
    return struct.pack(f"<{len(values)}f", *values)


def ply_of(packed):
    return (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(packed) // 12}\n"
            "property float x\nproperty float y\nproperty float z\nend_header\n").encode() + packed


class CoarseFirst(DaemonTest):
    def start(self, *arguments):
        file = self.folder / "surface.ply"
        if not file.exists():
            file.write_bytes(ply_of(corrugated(24000)))
            command = [PROGRAM, "compress", file, "-o", self.data / "m.mapc", "--codec", "surface", "--rms", "0.02",
                       "--tile-size", "8"]
            subprocess.run([str(c) for c in command], check=True, capture_output=True, timeout=300)
        super().start(*arguments)

    def test_every_tile_begins_coarse_and_is_sent_whole(self):
        _, plain = fetch(self.stub, map="m")
        _, both = fetch(self.stub, map="m", coarse_level=COARSE)
        coarse = [t for t in both if t[0].coarse_level]
        whole = [t for t in both if not t[0].coarse_level]
        self.assertEqual([(t.hash, b) for t, b in whole], [(t.hash, b) for t, b in plain])
        self.assertGreater(len(coarse), len(plain) // 2)
        self.assertEqual(both[:len(coarse)], coarse)
        bytes_of = {t.hash: b for t, b in plain}
        for tile, leading in coarse:
            self.assertEqual(tile.coarse_level, COARSE)
            self.assertEqual(list(tile.segment_bytes), [len(leading)])
            self.assertTrue(bytes_of[tile.hash].startswith(leading))
        self.assertLess(sum(len(b) for _, b in coarse), 0.6 * sum(len(b) for _, b in plain))

    def test_what_the_client_has_comes_neither_coarse_nor_whole(self):
        _, plain = fetch(self.stub, map="m")
        known = plain[0][0].hash
        _, both = fetch(self.stub, map="m", coarse_level=COARSE, if_none_match=known)
        about = [(t, b) for t, b in both if t.hash == known]
        self.assertEqual([(t.not_modified, t.coarse_level, b) for t, b in about], [(True, 0, b"")])

    def test_levels_that_do_not_exist_are_no_error(self):
        _, plain = fetch(self.stub, map="m")
        for level in (1, 2, 60, 4294967295):
            _, both = fetch(self.stub, map="m", coarse_level=level)
            self.assertEqual([b for t, b in both if not t.coarse_level], [b for _, b in plain], level)


class SlowReaders(DaemonTest):
    READERS = 24

    def resident_bytes(self):
        status = Path(f"/proc/{self.daemon.process.pid}/status").read_text()
        return 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))

    def test_they_cost_a_message_each_and_nobody_waits_for_them(self):
        self.create(promise=pb.CreateMapRequest.LOSSLESS, promise_m=0)
        for sequence in range(1, 11):
            insert(self.stub, "m", [scan(sequence, scan_of(sequence, 100000, spread=40))], writer="r")
        _, tiles = fetch(self.stub, map="m")
        size = sum(len(b) for _, b in tiles)
        self.assertGreater(size, 6 << 20)
        before = self.resident_bytes()
        streams = []
        for _ in range(self.READERS):
            channel = self.daemon.channel()
            self.addCleanup(channel.close)
            streams.append(rpc.MapServiceStub(channel).GetTiles(pb.GetTilesRequest(map="m"), timeout=300))
        for stream in streams:
            next(stream)  # each has begun; then nobody asks for more
        for _ in range(3):
            _, again = fetch(self.stub, map="m")
            self.assertEqual(sum(len(b) for _, b in again), size)
        grown = self.resident_bytes() - before
        # As a whole they were promised 24 x `size`; a message has about 1 MiB, and is held twice.
        self.assertLess(grown, memory_factor() * self.READERS * (4 << 20), f"{grown / 2**20:.0f} MiB for {size / 2**20:.0f} MiB of tiles")
        received = [0] * 3

        def drain(k):
            received[k] = sum(len(reply.data) for reply in streams[k])

        threads = [threading.Thread(target=drain, args=(k,)) for k in range(3)]
        for t in threads:
            t.start()
        for t in threads:
            t.join()
        self.assertEqual(received, [size] * 3)
        for stream in streams[3:]:
            stream.cancel()
        self.assertEqual(self.daemon.stop(), 0, self.daemon.said())


if __name__ == "__main__":
    unittest.main()
