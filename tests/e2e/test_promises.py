# SPDX-License-Identifier: GPL-3.0-or-later
"""What each promise says, measured here and not by the program."""
import math
import random
import unittest
from collections import Counter

from clouds import (FULL, RGB, XYZ, Cloud, Nearest, columns, pack, pcd_bytes, ply_bytes, positions, read_pcd, room,
                    symmetric_rms, to_float32, write)
from program import DIFFERENCE, ProgramTest


class Promises(ProgramTest):
    def round_trip(self, cloud, *flags):
        source = write(self.path("in.pcd"), pcd_bytes(cloud))
        archive = self.compress(source, *flags, "--force")
        self.succeeds("verify", archive)
        self.archive, self.source = archive, source
        return read_pcd(self.decompress(archive))

    def tearDown(self):
        if hasattr(self, "archive"):  # after what was measured here, what the program says of itself
            self.succeeds("verify", self.archive, "--against", self.source)

    def assert_axis_error(self, cloud, decoded, bound):
        a, b = positions(cloud), positions(decoded)
        self.assertEqual(len(a), len(b))
        slack = 1e-6  # float32 in the output file
        for p, q in ((a, b), (b, a)):
            index = Nearest(q, 4 * bound)
            self.assertLessEqual(max(index.axis_error(v) for v in p), bound + slack)

    def test_max_error(self):
        cloud = room(5000)
        for bound in (0.0005, 0.005, 0.05):
            self.assert_axis_error(cloud, self.round_trip(cloud, "--max-error", bound), bound)

    def test_rms(self):
        cloud = room(5000)
        for bound in (0.003, 0.02):
            decoded = self.round_trip(cloud, "--rms", bound)
            self.assertLessEqual(symmetric_rms(positions(cloud), positions(decoded), 0.3), bound * 1.0001)

    def test_rms_uses_surfaces_and_comes_close(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(60000, XYZ, noise=0.002)))
        archive = self.compress(source, "--rms", 0.03, "--threads", 1)
        info = self.succeeds("info", archive, "--json").json
        self.assertIn("surface", info["codecs"])
        self.assertEqual(info["points"], 60000)
        measured = self.succeeds("evaluate", source, archive, "--json").json
        self.assertLessEqual(measured["rms_m"], 0.03)
        self.assertGreaterEqual(measured["rms_m"], 0.9 * 0.03)
        self.assertEqual(measured["count_ratio"], 1)
        again = self.compress(source, "--rms", 0.03, "--threads", 2, name="again.mapc")
        self.assertEqual(archive.read_bytes(), again.read_bytes())
        self.succeeds("verify", archive, "--against", source)

    def test_high_effort_tries_side_by_side_and_gives_the_same_bytes(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(8000, XYZ, noise=0.002)))
        one, two = (self.compress(source, "--rms", 0.05, "--effort", "high", "--threads", n, name=f"{n}.mapc")
                    for n in (1, 2))
        self.assertEqual(one.read_bytes(), two.read_bytes())
        self.succeeds("verify", one, "--against", source)

    def test_codecs_of_one_map_may_differ(self):
        """A wall beside dust: surfaces for the one, points for the other (a longer search finds that surfaces alone take
        as little, with blocks of voxels for the dust)."""
        r = random.Random(3)
        wall = [(r.random() * 4, r.random() * 4, r.gauss(0, 0.002)) for _ in range(40000)]
        dust = [tuple(20 + r.random() * 4 for _ in range(3)) for _ in range(30000)]
        cloud = Cloud(XYZ, [tuple(to_float32(v) for v in p) for p in wall + dust])
        source = write(self.path("in.pcd"), pcd_bytes(cloud))
        archive = self.compress(source, "--rms", 0.02, "--tile-size", 8, "--effort", "fast")
        codecs = self.succeeds("info", archive, "--json").json["codecs"]
        self.assertEqual(set(codecs), {"surface", "points"})
        self.assertEqual(len(read_pcd(self.decompress(archive)).rows), len(cloud.rows))
        part = read_pcd(self.decompress(archive, "--box", "0,0,-1,2,4,1", "--force"))
        self.assertTrue(all(p[0] <= 2 for p in positions(part)))
        self.assertAlmostEqual(len(part.rows), 20000, delta=600)
        self.succeeds("verify", archive, "--against", source)

    def test_one_codec_may_be_asked_for(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(20000, XYZ)))
        for codec in ("surface", "points"):
            archive = self.compress(source, "--rms", 0.02, "--codec", codec, "--force")
            self.assertEqual(set(self.succeeds("info", archive, "--json").json["codecs"]), {codec})
            self.succeeds("verify", archive, "--against", source)

    def test_resampled_points_have_no_ring(self):
        cloud = room(20000)
        source = write(self.path("in.pcd"), pcd_bytes(cloud))
        said = self.succeeds("compress", source, "-o", self.path("map.mapc"), "--rms", 0.05, "--codec", "surface").err
        self.assertRegex(said, "'ring' is not kept.*--max-error")
        kept = {c["name"]: c["kept"] for c in self.succeeds("info", self.path("map.mapc"), "--json").json["channels"]}
        self.assertEqual((kept["ring"], kept["intensity"], kept["rgb"]), ("dropped", "bounded", "bounded"))

    def test_rms_of_one_point_many_times(self):
        source = write(self.path("in.pcd"), pcd_bytes(Cloud(XYZ, [(1.0, 2.0, 3.0)] * 500)))
        archive = self.compress(source, "--rms", 0.01)
        self.assertEqual(self.succeeds("info", archive, "--json").json["points"], 500)
        self.succeeds("verify", archive, "--against", source)

    def test_rms_is_the_default(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(3000)))
        info = self.succeeds("info", self.compress(source), "--json").json
        self.assertEqual(info["promise"], {"kind": "rms", "value": 0.01})

    def test_lossless_keeps_every_bit(self):
        cloud = room(5000)
        for flags in ((), ("--tile-size", 1.5)):
            decoded = self.round_trip(cloud, "--lossless", *flags)
            names = [n for n, _ in cloud.fields]
            self.assertEqual(Counter(cloud.rows), Counter(columns(decoded, names)))

    def test_lossless_keeps_the_order_when_asked(self):
        cloud = room(4000)
        decoded = self.round_trip(cloud, "--lossless", "--keep-order", "--tile-size", 2)
        self.assertEqual(cloud.rows, columns(decoded, [n for n, _ in cloud.fields]))

    def test_lossless_keeps_nan_points(self):
        nan = float("nan")
        cloud = room(1000, XYZ)
        cloud = Cloud(XYZ, cloud.rows + [(nan, nan, nan), (1.0, nan, 2.0), (float("inf"), 0.0, 0.0)])
        source = write(self.path("in.pcd"), pcd_bytes(cloud))
        decoded = read_pcd(self.decompress(self.compress(source, "--lossless")))
        packed = lambda c: Counter(pack(Cloud(XYZ, [r])) for r in positions(c))
        self.assertEqual(packed(cloud), packed(decoded))

    def test_lossless_doubles(self):
        fields = (("x", "d"), ("y", "d"), ("z", "d"))
        cloud = room(2000, fields, offset=(500000.125, 4649776.0625, 100))
        source = write(self.path("utm.ply"), ply_bytes(cloud))
        archive = self.compress(source, "--lossless")
        decoded = read_pcd(self.decompress(archive))
        self.assertEqual(Counter(cloud.rows), Counter(positions(decoded)))

    def test_color_error(self):
        cloud = room(5000, RGB)
        for bound in (3, 10):
            info_of = self.round_trip(cloud, "--max-error", 0.002, "--color-error", bound)
            self.assertLessEqual(self.mean_color_error(cloud, info_of), bound * 1.1)
        exact = self.round_trip(cloud, "--max-error", 0.002, "--color-error", 0)
        self.assertEqual(Counter(columns(cloud, ["rgb"])), Counter(columns(exact, ["rgb"])))

    def mean_color_error(self, cloud, decoded):
        """Of decoded points to the nearest original; the program takes the mean of both directions."""
        color = dict(zip(positions(cloud), columns(cloud, ["rgb"])))
        index = Nearest(positions(cloud), 0.05)
        total = 0
        for p, (rgb,) in zip(positions(decoded), columns(decoded, ["rgb"])):
            q = min(index.candidates(p), key=lambda v: sum((a - b) ** 2 for a, b in zip(p, v)))
            total += sum(((rgb >> s & 255) - (color[q][0] >> s & 255)) ** 2 for s in (0, 8, 16)) ** 0.5
        return total / len(decoded.rows)

    def test_positions_are_finer_where_that_makes_colors_smaller(self):
        """A sheet in waves, painted like a chessboard."""
        r = random.Random(5)
        rows = []
        for _ in range(30000):
            x, y = r.random() * 4, r.random() * 4
            z = 0.1 * math.sin(2 * math.pi * x / 0.6) * math.sin(2 * math.pi * y / 0.6)
            rgb = 0xC83C3C if int(x / 0.4) + int(y / 0.4) & 1 else 0x3C3CC8
            rows.append((*(to_float32(v) for v in (x, y, z)), rgb))
        source = write(self.path("in.pcd"), pcd_bytes(Cloud(RGB, rows)))
        said = self.succeeds("compress", source, "-o", self.path("map.mapc"), "--rms", 0.1, "--threads", 1).err
        self.assertRegex(said, r"RMS of \S+ mm: finer ones make the colours")
        info = self.succeeds("info", self.path("map.mapc"), "--json").json
        self.assertEqual(info["promise"], {"kind": "rms", "value": 0.1})
        self.assertLess(info["achieved"]["rms_m"], 0.06)
        fast = self.compress(source, "--rms", 0.1, "--effort", "fast", name="fast.mapc")  # does not look
        self.assertLess(self.path("map.mapc").stat().st_size, 0.8 * fast.stat().st_size)
        again = self.compress(source, "--rms", 0.1, "--threads", 2, name="again.mapc")
        self.assertEqual(again.read_bytes(), self.path("map.mapc").read_bytes())
        again = self.compress(source, "--rms", 0.1, "--force", name="again.mapc")  # over one that is there
        self.assertEqual(again.read_bytes(), self.path("map.mapc").read_bytes())
        self.succeeds("verify", again, "--against", source)

    def test_scalars_are_exact_unless_said_otherwise(self):
        cloud = room(3000, FULL)
        decoded = self.round_trip(cloud, "--max-error", 0.002)
        self.assertEqual(Counter(columns(cloud, ["ring"])), Counter(columns(decoded, ["ring"])))

    def test_paper(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(20000, RGB, noise=0.002)))
        archive = self.compress(source, "--paper", "--tile-size", 20)
        self.succeeds("verify", archive)
        info = self.succeeds("info", archive, "--json").json
        self.assertEqual(info["promise"]["kind"], "paper")
        self.assertIn("paper", info["codecs"])
        measured = self.succeeds("evaluate", source, archive, "--json").json
        self.assertLess(measured["rms_m"], 0.1)

    def test_target_size_is_met(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(20000, XYZ)))
        archive = self.compress(source, "--target-bpp", 6, "--tile-size", 20)
        bits = 8 * archive.stat().st_size / 20000
        self.assertLessEqual(bits, 6.3)
        self.assertGreater(bits, 5.7)
        archive = self.compress(source, "--target-ratio", 0.06, "--tile-size", 20, "--force")
        self.assertLessEqual(archive.stat().st_size / (12 * 20000), 0.063)

    def test_verify_tells_another_original(self):
        source = write(self.path("in.pcd"), pcd_bytes(room(3000)))
        other = write(self.path("other.pcd"), pcd_bytes(room(3000, seed=2)))
        archive = self.compress(source, "--max-error", 0.001)
        self.fails(DIFFERENCE, "verify", archive, "--against", other)


if __name__ == "__main__":
    unittest.main()
