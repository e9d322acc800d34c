# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways that a user goes: compress, look, extract, tune. What is promised about errors is in test_promises."""
import json
import unittest

from clouds import FULL, RGB, XYZ, pcd_bytes, ply_bytes, positions, read_pcd, room, write
from program import ProgramTest, run

INFO_KEYS = {"format_version", "points", "tiles", "bytes", "bits_per_point", "ratio", "input_bytes", "promise", "achieved",
             "bounds", "tile_size_m", "channels", "codecs", "revision", "submaps"}
COMPRESS_KEYS = INFO_KEYS | {"encode_seconds", "points_per_second", "threads", "peak_memory_bytes"}
EVALUATE_KEYS = {"points_original", "points_decoded", "count_ratio", "rms_m", "rms_ab_m", "rms_ba_m", "rms_pool_m", "max_m",
                 "max_axis_error_m", "d1_psnr_db", "d2_psnr_db", "color_error", "y_psnr_db", "density_error", "bytes",
                 "bits_per_point", "ratio"}


class MainPaths(ProgramTest):
    def setUp(self):
        super().setUp()
        self.cloud = room(6000)
        self.source = write(self.path("room.pcd"), pcd_bytes(self.cloud))

    def test_version_and_help(self):
        self.assertRegex(self.succeeds("--version").out, r"\d+\.\d+\.\d+")
        for verb in ("compress", "decompress", "info", "verify", "evaluate"):
            self.assertIn(verb, self.succeeds("--help").out)
            self.assertIn("--", self.succeeds(verb, "--help").out)

    def test_json_of_compress_and_info(self):
        out = self.succeeds("compress", self.source, "-o", self.path("a.mapc"), "--max-error", 0.005, "--json").json
        self.assertLessEqual(COMPRESS_KEYS, set(out))
        info = self.succeeds("info", self.path("a.mapc"), "--json").json
        self.assertLessEqual(INFO_KEYS, set(info))
        for key in ("points", "tiles", "bytes", "promise", "achieved", "bounds", "tile_size_m", "channels", "codecs"):
            self.assertEqual(out[key], info[key], key)
        self.assertEqual(info["points"], 6000)
        self.assertEqual(info["bytes"], self.path("a.mapc").stat().st_size)
        self.assertEqual(info["input_bytes"], self.source.stat().st_size)
        self.assertAlmostEqual(info["bits_per_point"], 8 * info["bytes"] / 6000, places=6)
        self.assertEqual(info["promise"], {"kind": "max_error", "value": 0.005})
        self.assertLessEqual({"rms_m", "max_axis_error_m", "color_error", "density_error"}, set(info["achieved"]))
        self.assertEqual(sum(c["tiles"] for c in info["codecs"].values()), info["tiles"])
        self.assertEqual(sum(c["points"] for c in info["codecs"].values()), 6000)
        self.assertEqual([c["name"] for c in info["channels"] if c["name"] != "alpha"], ["rgb", "intensity", "ring"])
        for channel in info["channels"]:
            self.assertLessEqual({"name", "type", "kept"}, set(channel))
        lo, hi = (list(f(p[k] for p in positions(self.cloud)) for k in range(3)) for f in (min, max))
        for k in range(3):
            self.assertAlmostEqual(info["bounds"]["min"][k], lo[k], delta=0.006)
            self.assertAlmostEqual(info["bounds"]["max"][k], hi[k], delta=0.006)

    def test_info_for_people(self):
        archive = self.compress(self.source)
        self.assertIn("6000", self.succeeds("info", archive).out.replace(",", "").replace(" ", "").replace("'", ""))
        self.assertTrue(self.succeeds("info", archive, "--tiles").out)

    def test_ratio_counts_twelve_bytes_and_the_kept_channels(self):
        for flag, raw in (("all", 12 + 4 + 4 + 2), ("none", 12), ("rgb", 16)):
            info = self.succeeds("info", self.compress(self.source, "--channels", flag, "--force"), "--json").json
            self.assertAlmostEqual(info["ratio"], info["bytes"] / (raw * 6000), places=6, msg=flag)

    def test_json_of_evaluate(self):
        archive = self.compress(self.source, "--max-error", 0.01)
        decoded = self.decompress(archive)
        for other in (archive, decoded):
            out = self.succeeds("evaluate", self.source, other, "--json").json
            self.assertLessEqual(EVALUATE_KEYS, set(out))
            self.assertEqual(out["points_original"], 6000)
            self.assertEqual(out["points_decoded"], 6000)
            self.assertAlmostEqual(out["rms_m"], max(out["rms_ab_m"], out["rms_ba_m"]), places=9)
            self.assertLessEqual(out["max_axis_error_m"], 0.01)
        self.assertAlmostEqual(self.succeeds("evaluate", self.source, archive, "--json").json["bits_per_point"],
                               8 * archive.stat().st_size / 6000, places=6)

    def test_a_cloud_equals_itself(self):
        out = self.succeeds("evaluate", self.source, self.source, "--json").json
        self.assertEqual((out["rms_m"], out["max_m"], out["color_error"], out["density_error"]), (0, 0, 0, 0))

    def test_box_and_sphere_give_what_the_whole_gives_there(self):
        archive = self.compress(self.source, "--max-error", 0.002, "--tile-size", 1.5)
        whole = read_pcd(self.decompress(archive)).rows
        box = read_pcd(self.decompress(archive, "--box", "1,1,-1,3,2.5,2", name="box.pcd")).rows
        inside = [r for r in whole if 1 <= r[0] <= 3 and 1 <= r[1] <= 2.5 and -1 <= r[2] <= 2]
        self.assertGreater(len(inside), 100)
        self.assertEqual(sorted(box), sorted(inside))
        ball = read_pcd(self.decompress(archive, "--sphere", "2,2,0,1", name="ball.pcd")).rows
        inside = [r for r in whole if (r[0] - 2) ** 2 + (r[1] - 2) ** 2 + r[2] ** 2 <= 1]
        self.assertEqual(sorted(ball), sorted(inside))

    def test_a_box_that_touches_nothing(self):
        archive = self.compress(self.source)
        out = run("decompress", archive, "-o", self.path("none.pcd"), "--box", "100,100,100,101,101,101")
        self.assertIn(out.code, (0, 3), out)
        if out.code == 0:
            self.assertEqual(read_pcd(self.path("none.pcd")).rows, [])
        else:
            self.one_error_line(out)
            self.assertFalse(self.path("none.pcd").exists())

    def test_same_bytes_for_any_threads_and_twice(self):
        for promise in (("--rms", 0.01), ("--max-error", 0.005), ("--lossless",)):
            flags = (*promise, "--tile-size", 2)
            one = self.compress(self.source, *flags, "--threads", 1, name="one.mapc").read_bytes()
            for n, threads in (("two", 2), ("again", 2), ("all", 0)):
                other = self.compress(self.source, *flags, "--threads", threads, name=n + ".mapc").read_bytes()
                self.assertEqual(one, other, f"{promise}, {threads} threads")
                self.path(n + ".mapc").unlink()
            decoded = [self.decompress(self.path("one.mapc"), "--threads", t, name=f"{t}.pcd").read_bytes() for t in (1, 2)]
            self.assertEqual(decoded[0], decoded[1])
            self.path("one.mapc").unlink()

    def test_spilling_to_disk_changes_no_byte(self):
        source = write(self.path("big.pcd"), pcd_bytes(room(150000, RGB)))
        flags = ("--max-error", 0.005, "--tile-size", 1)
        free = self.compress(source, *flags, name="free.mapc").read_bytes()
        before = self.listing()
        tight = self.compress(source, *flags, "--max-memory", "4M", name="tight.mapc").read_bytes()
        self.assertEqual(free, tight)
        self.assertEqual(self.listing(), sorted(before + ["tight.mapc"]), "spill files stay behind")

    def test_several_inputs_make_one_map(self):
        other = write(self.path("other.pcd"), pcd_bytes(room(2000, FULL, seed=7, offset=(20, 0, 0)), data="ascii"))
        archive = self.path("both.mapc")
        self.succeeds("compress", self.source, other, "-o", archive, "--max-error", 0.005)
        info = self.succeeds("info", archive, "--json").json
        self.assertEqual(info["points"], 8000)
        self.assertGreater(info["bounds"]["max"][0], 20)

    def test_pcd_and_ply_colour_make_one_map(self):
        pcd = write(self.path("a.pcd"), pcd_bytes(room(2000, RGB)))
        ply = write(self.path("b.ply"), ply_bytes(room(1000, RGB, seed=7)))
        for inputs in ((pcd, ply), (ply, pcd)):
            out = self.succeeds("compress", *inputs, "-o", self.path("both.mapc"), "--force", "--max-error", 0.005)
            self.assertRegex(out.err, r"fourth byte of its colour \(alpha\) is not kept")
            info = self.succeeds("info", self.path("both.mapc"), "--json").json
            self.assertEqual(info["points"], 3000)
            self.assertEqual([c["name"] for c in info["channels"] if c["kept"] != "dropped"], ["rgb"])
        self.fails(2, "compress", *inputs, "-o", self.path("exact.mapc"), "--lossless", says="has no channel alpha")

    def test_what_a_pcd_header_loses_is_said(self):
        head, rest = pcd_bytes(self.cloud).split(b"WIDTH 6000\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n")
        data = head + b"WIDTH 100\nHEIGHT 60\nVIEWPOINT 1 2 0 1 0 0 0\n" + rest
        grid = write(self.path("grid.pcd"), data)
        out = self.succeeds("compress", grid, "-o", self.path("grid.mapc"))
        self.assertRegex(out.err, "its grid of 100 x 60 points and its VIEWPOINT are not kept")

    def test_channels_choose(self):
        for flag, kept in (("none", []), ("rgb", ["rgb"]), ("ring,intensity", ["intensity", "ring"])):
            archive = self.compress(self.source, "--channels", flag, "--force")
            names = [n for n, _ in read_pcd(self.decompress(archive)).fields]
            self.assertEqual(names, ["x", "y", "z", *kept], flag)
            info = self.succeeds("info", archive, "--json").json
            dropped = {c["name"] for c in info["channels"] if c["kept"] == "dropped"}
            self.assertEqual(dropped - {"alpha"}, {"rgb", "intensity", "ring"} - set(kept))

    def test_tile_size_is_taken(self):
        info = self.succeeds("info", self.compress(self.source, "--tile-size", 2), "--json").json
        self.assertEqual(info["tile_size_m"], 2)
        self.assertGreater(info["tiles"], 6)

    def test_every_effort_keeps_the_promise(self):
        for effort in ("fast", "default", "high"):
            archive = self.compress(self.source, "--max-error", 0.004, "--effort", effort, "--force")
            self.succeeds("verify", archive, "--against", self.source)

    def test_output_formats_are_read_back(self):
        archive = self.compress(self.source, "--max-error", 0.002)
        for suffix in ("pcd", "ply", "las", "xyz"):
            out = self.decompress(archive, name="out." + suffix)
            measured = self.succeeds("evaluate", self.source, out, "--json").json
            self.assertEqual(measured["points_decoded"], 6000, suffix)
            self.assertLess(measured["max_axis_error_m"], 0.0035, suffix)

    def test_progress_as_json_lines(self):
        outcome = self.succeeds("compress", self.source, "-o", self.path("p.mapc"), "--max-error", 0.01, "--progress", "json")
        for line in outcome.err.splitlines():
            json.loads(line)

    def test_quiet_where_nothing_is_wrong(self):
        outcome = self.succeeds("compress", write(self.path("plain.pcd"), pcd_bytes(room(500, XYZ))), "-o", self.path("q.mapc"),
                                "--progress", "none", "--max-error", 0.01)
        self.assertEqual(outcome.err, "")


if __name__ == "__main__":
    unittest.main()
