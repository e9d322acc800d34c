# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps that live: update, remove, crop, pose, merge, and the revisions that come of it."""
import fcntl
import unittest

from clouds import FULL, RGB, XYZ, pcd_bytes, positions, read_pcd, room, write
from program import BAD_INPUT, CANNOT_WRITE, DONE, USAGE, ProgramTest, run


class Living(ProgramTest):
    def setUp(self):
        super().setUp()
        self.first = write(self.path("first.pcd"), pcd_bytes(room(4000, seed=1)))
        self.second = write(self.path("second.pcd"), pcd_bytes(room(4000, seed=2, offset=(5, 0, 0))))
        self.map = self.path("map.mapc")

    def info(self, *flags):
        return self.succeeds("info", self.map, "--json", *flags).json

    def points(self, *flags):
        return positions(read_pcd(self.decompress(self.map, *flags)))

    def test_update_adds_a_revision(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        out = self.succeeds("update", self.map, self.second, "--json").json
        self.assertEqual((out["revision"], out["committed"], out["points_in"]), (2, True, 4000))
        self.assertGreater(out["points_added"], 3900)
        self.assertEqual(self.info()["points"], 4000 + out["points_added"])
        self.succeeds("verify", self.map)
        before = positions(read_pcd(self.decompress(self.map, "--revision", 1)))
        self.assertEqual(len(before), 4000)
        self.assertEqual(len(self.points()), 4000 + out["points_added"])

    def test_the_same_again_changes_no_byte(self):
        for promise in (("--rms", 0.01), ("--max-error", 0.005), ("--lossless",)):
            with self.subTest(promise=promise):
                self.succeeds("update", self.map, self.first, "--create", *promise)
                before = self.map.read_bytes()
                out = self.succeeds("update", self.map, self.first, "--json").json
                self.assertFalse(out["committed"])
                self.assertEqual(self.map.read_bytes(), before)
                self.map.unlink()

    def test_a_map_begun_empty_keeps_its_promise(self):
        self.succeeds("update", self.map, self.first, "--create", "--rms", 0.02)
        self.succeeds("update", self.map, self.second)
        both = write(self.path("both.pcd"), pcd_bytes(room(4000, seed=1)._replace(
            rows=room(4000, seed=1).rows + room(4000, seed=2, offset=(5, 0, 0)).rows)))
        self.assertLessEqual(self.succeeds("evaluate", both, self.map, "--json").json["rms_m"], 0.02)
        self.succeeds("compact", self.map)
        self.assertLessEqual(self.succeeds("evaluate", both, self.map, "--json").json["rms_m"], 0.02)
        compacted = self.map.read_bytes()
        self.succeeds("compact", self.map)
        self.assertEqual(self.map.read_bytes(), compacted)

    def test_another_promise_or_other_channels_are_refused(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        before = self.map.read_bytes()
        bare = write(self.path("bare.pcd"), pcd_bytes(room(100, fields=XYZ)))
        self.fails(BAD_INPUT, "update", self.map, bare, names=bare, says="rgb")
        self.fails((USAGE, BAD_INPUT), "update", self.map, self.second, "--rms", 0.01, says="promise")
        self.fails(BAD_INPUT, "update", self.map, self.path("none.pcd"), names="none.pcd")
        self.fails(BAD_INPUT, "update", self.path("no.mapc"), self.second, names="no.mapc")
        self.assertEqual(self.map.read_bytes(), before)

    def test_poses_are_checked(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        for pose in ("0,0,0,0,0,0,2", "nan,0,0,0,0,0,1", "1,2,3"):
            self.fails(USAGE, "update", self.map, self.second, "--pose", pose)
            self.fails(USAGE, "pose", self.map, "--submap", "a", "--pose", pose)
        self.fails(BAD_INPUT, "pose", self.map, "--submap", "nowhere", "--pose", "0,0,0,0,0,0,1", says="nowhere")

    def test_submaps_move_and_no_tile_is_touched(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        self.succeeds("update", self.map, self.second, "--submap", "room 2", "--pose", "100,0,0,0,0,0,1")
        self.assertEqual(self.info()["submaps"], 2)
        far = ("--box", "90,-20,-20,130,20,20")
        self.assertEqual(len(self.points(*far)), 4000)
        tiles = self.info("--tiles")["tile_list"]
        self.succeeds("pose", self.map, "--submap", "room 2", "--pose", "0,200,0,0,0,0,1")
        self.assertEqual(run("decompress", self.map, "-o", self.path("x.pcd"), *far).code, BAD_INPUT)
        self.assertEqual(len(self.points("--box", "-20,190,-20,30,220,20")), 4000)
        if tiles is not None:
            self.assertEqual(self.info("--tiles")["tile_list"], tiles)
        self.assertEqual(len(self.points()), 8000)

    def test_remove_and_crop(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        low = [p for p in self.points() if p[0] <= 4]
        self.succeeds("remove", self.map, "--box", "4,-9,-9,99,99,99")
        self.assertEqual(sorted(self.points()), sorted(p for p in low if not p[0] >= 4))
        self.succeeds("compact", self.map)
        self.assertEqual(sorted(self.points()), sorted(p for p in low if not p[0] >= 4))
        self.succeeds("crop", self.map, "--sphere", "0,0,0,2")
        self.assertTrue(all(sum(c * c for c in p) <= 4.0001 for p in self.points()))
        self.fails(USAGE, "remove", self.map)
        self.fails(USAGE, "remove", self.map, "--box", "1,1,1,0,0,0")
        self.fails(USAGE, "remove", self.map, "--where", "ring")
        self.succeeds("remove", self.map, "--where", "ring:0:15")
        rings = [row[-1] for row in read_pcd(self.decompress(self.map)).rows]
        self.assertTrue(rings and min(rings) >= 16)
        self.fails(BAD_INPUT, "remove", self.map, "--where", "label:0:15", says="label")

    def test_merge(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        other = self.path("other.mapc")
        self.succeeds("compress", self.second, "-o", other, "--max-error", 0.005, "--tile-size", 3)
        self.succeeds("update", other, self.first, "--submap", "kitchen", "--pose", "50,0,0,0,0,0,1")
        kept = other.read_bytes()
        self.succeeds("merge", self.map, other)
        self.assertEqual(self.info()["submaps"], 2)
        self.assertEqual(len(self.points("--box", "45,-9,-9,70,20,20")), 4000)
        self.assertEqual(other.read_bytes(), kept)
        self.fails((USAGE, BAD_INPUT), "merge", self.map, self.map)

    def test_flatten(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        self.succeeds("update", self.map, self.second, "--submap", "room 2", "--pose", "100,0,0,0,0,1,0")
        flat = self.path("flat.mapc")
        self.succeeds("flatten", self.map, "-o", flat)
        info = self.succeeds("info", flat, "--json").json
        self.assertEqual((info["points"], info["submaps"]), (8000, 1))
        apart = self.succeeds("evaluate", self.map, flat, "--json").json
        self.assertLessEqual(apart["max_axis_error_m"], 0.0051)
        self.fails(CANNOT_WRITE, "flatten", self.map, "-o", flat, names=flat)
        self.fails(BAD_INPUT, "flatten", self.path("no.mapc"), "-o", self.path("x.mapc"), names="no.mapc")

    def test_history(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        self.succeeds("snapshot", self.map, "before")
        self.succeeds("update", self.map, self.second)
        self.assertIn("before", self.succeeds("log", self.map).out)
        self.assertEqual(run("diff", self.map, "before", "3").code, DONE)
        self.succeeds("rollback", self.map, "before")
        self.assertEqual(len(self.points()), 4000)
        self.succeeds("compact", self.map)
        self.succeeds("verify", self.map)
        self.assertEqual(len(self.points("--revision", "before")), 4000)

    def test_two_writers(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        before = self.map.read_bytes()
        with open(self.map, "rb") as other:
            fcntl.flock(other, fcntl.LOCK_EX)
            for work in (("update", self.map, self.second), ("compact", self.map), ("remove", self.map, "--box", "0,0,0,1,1,1"),
                         ("snapshot", self.map, "x")):
                self.fails(CANNOT_WRITE, *work, names=self.map, says="another program is writing")
            self.succeeds("verify", self.map)  # readers need no lock
        self.assertEqual(self.map.read_bytes(), before)
        self.succeeds("update", self.map, self.second)

    def test_a_newer_format_or_no_archive(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        newer = bytearray(self.map.read_bytes())
        newer[6] = 9
        newer = write(self.path("newer.mapc"), newer)
        for archive, says in ((newer, "version 9"), (self.first, "not a mapcodec archive"), (self.path("gone.mapc"), "no such file")):
            for work in (("update", archive, self.second), ("remove", archive, "--box", "0,0,0,1,1,1"), ("merge", archive, self.map),
                         ("pose", archive, "--submap", "a", "--pose", "0,0,0,0,0,0,1")):
                self.fails(BAD_INPUT, *work, names=archive, says=says)
        self.assertFalse(self.path("gone.mapc").exists())

    def test_read_only_map(self):
        self.succeeds("compress", self.first, "-o", self.map, "--max-error", 0.005)
        self.map.chmod(0o444)
        outcome = run("update", self.map, self.second)
        self.assertIn(outcome.code, (DONE, CANNOT_WRITE))  # root may write all


if __name__ == "__main__":
    unittest.main()
