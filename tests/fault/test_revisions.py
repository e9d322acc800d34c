# SPDX-License-Identifier: GPL-3.0-or-later
"""The verbs about revisions as a person runs them: log, snapshot, diff, rollback, compact, repair."""
import os
import random
import stat
import unittest

from clouds import pcd_bytes, room, write
from program import BAD_INPUT, CANNOT_WRITE, DAMAGED, DIFFERENCE, DONE, USAGE, ProgramTest, run, start


class Revisions(ProgramTest):
    def setUp(self):
        super().setUp()
        self.source = write(self.path("in.pcd"), pcd_bytes(room(3000)))
        self.map = self.compress(self.source, "--max-error", 0.01, "--tile-size", 2.5)

    def json(self, *arguments):
        return self.succeeds(*arguments, "--json").json

    def test_names_and_rollback(self):
        before = self.map.read_bytes()
        self.succeeds("snapshot", self.map, "as built")
        self.assertEqual(self.map.read_bytes()[: len(before)], before)
        log = self.json("log", self.map)
        self.assertEqual([r["revision"] for r in log["revisions"]], [2, 1])
        self.assertEqual(log["revisions"][1]["snapshots"], ["as built"])
        self.assertEqual(self.json("rollback", self.map, "as built")["revision"], 3)
        difference = self.json("diff", self.map, "as built", 3)
        self.assertEqual((difference["added"], difference["changed"], difference["removed"]), (0, 0, 0))
        self.succeeds("verify", self.map, "--against", self.source)
        self.succeeds("snapshot", self.map, "as built", "--remove")
        self.fails(BAD_INPUT, "diff", self.map, "as built", 3, names=self.map, says="no snapshot")

    def test_output_fits_a_terminal(self):
        self.succeeds("snapshot", self.map, "a name that is much longer than any line of a terminal " * 3)
        for verb in (("log", self.map), ("diff", self.map, 1, 2), ("compact", self.map.name), ("log", self.map)):
            for line in self.succeeds(*verb, cwd=self.folder).out.splitlines():
                self.assertLessEqual(len(line.replace(str(self.map), "map.mapc")), 80, line)

    def test_compaction(self):
        for n in range(5):
            self.succeeds("rollback", self.map, 1)
        out = self.decompress(self.map).read_bytes()
        report = self.json("compact", self.map)
        once = self.map.read_bytes()
        self.assertEqual((report["revisions_before"], report["revisions_after"]), (6, 1))
        self.assertEqual(report["bytes_after"], len(once))
        self.assertLess(report["bytes_after"], report["bytes_before"])
        self.succeeds("compact", self.map)
        self.assertEqual(self.map.read_bytes(), once)
        self.assertEqual(self.json("log", self.map)["revisions"][0]["revision"], 6)
        self.assertEqual(self.decompress(self.map).read_bytes(), out)
        self.json("compact", self.map, "--hashes", "on")
        tiles = self.json("info", self.map)["tiles"]
        self.assertLess(len(self.map.read_bytes()) - len(once), 16 * tiles + 16)
        self.succeeds("verify", self.map)
        self.fails(BAD_INPUT, "rollback", self.map, 1, says="no revision 1")

    def test_bad_use(self):
        self.fails(USAGE, "snapshot", self.map, "17", says="digits")
        self.fails(USAGE, "snapshot", self.map, "", says="name")
        self.fails(USAGE, "snapshot", self.map)
        self.fails(USAGE, "compact", self.map, "--keep", 0)
        self.fails(BAD_INPUT, "diff", self.map, 1, 99, names=self.map, says="no revision 99")
        self.fails(BAD_INPUT, "rollback", self.map, "../in.pcd", names=self.map, says="no snapshot")
        self.fails(BAD_INPUT, "rollback", self.map, "-1; rm -rf", says="no snapshot")
        for verb in (("log",), ("snapshot", "x"), ("diff", "1", "1"), ("rollback", "1"), ("compact",)):
            self.fails(BAD_INPUT, verb[0], self.path("none.mapc"), *verb[1:], names="none.mapc")
            self.fails(BAD_INPUT, verb[0], self.source, *verb[1:], names="in.pcd", says="not a mapcodec archive")
            self.fails((BAD_INPUT, CANNOT_WRITE), verb[0], self.folder, *verb[1:], says="folder")
        newer = bytearray(self.map.read_bytes())
        newer[6] = 9
        newer = write(self.path("newer.mapc"), newer)
        for verb in (("log",), ("snapshot", "x"), ("compact",)):
            self.fails(BAD_INPUT, verb[0], newer, *verb[1:], says="version 9")

    def test_control_characters_are_not_printed(self):
        self.fails(USAGE, "snapshot", self.map, "\x1b[2Jx", says="control")
        self.assertNotIn("\x1b", run("rollback", self.map, "\x1b[2J").out)

    @unittest.skipIf(os.geteuid() == 0, "root may write everything")
    def test_read_only(self):
        self.map.chmod(stat.S_IRUSR)
        before = self.map.read_bytes()
        for verb in (("snapshot", "x"), ("rollback", "1"), ("compact",)):
            self.fails(CANNOT_WRITE, verb[0], self.map, *verb[1:], names=self.map)
        self.succeeds("log", self.map)
        self.assertEqual(self.map.read_bytes(), before)

    def test_many_at_once_lose_nothing(self):
        work = [start("snapshot", self.map, f"name {n}") for n in range(12)] + [start("compact", self.map) for _ in range(4)]
        codes = []
        for process in work:
            process.communicate()
            codes.append(process.returncode)
        self.assertTrue(set(codes) <= {DONE, CANNOT_WRITE}, codes)
        named = {f"name {n}" for n in range(12) if codes[n] == DONE}
        self.assertTrue(named)
        self.succeeds("verify", self.map)
        found = {s for r in self.json("log", self.map)["revisions"] for s in r["snapshots"]}
        self.assertEqual(found, named)

    def test_repair(self):
        whole = self.map.read_bytes()
        fixed = self.path("fixed.mapc")
        self.assertTrue(self.json("repair", self.map, "-o", fixed)["saved_all"])
        self.succeeds("verify", fixed, "--against", self.source)
        self.fails(CANNOT_WRITE, "repair", self.map, "-o", fixed, names=fixed, says="exists")
        self.fails(CANNOT_WRITE, "repair", self.map, "-o", self.map, "--force", says="itself")
        self.fails(USAGE, "repair", self.map)
        points = self.json("info", self.map)["points"]
        r = random.Random(1)
        outcomes = {DONE: 0, DIFFERENCE: 0}
        for _ in range(40):
            data = bytearray(whole)
            data[r.randrange(len(data))] ^= 1 << r.randrange(8)
            write(self.map, data)
            outcome = run("repair", self.map, "-o", fixed, "--force", "--json")
            outcomes[outcome.code] += 1
            report = outcome.json
            self.assertEqual(self.map.read_bytes(), data)
            self.succeeds("verify", fixed)
            self.assertEqual(report["points_saved"] + report["points_lost"], points)
            if outcome.code == DONE:
                self.assertEqual(len(report["corrected"]), 1)
                self.succeeds("verify", fixed, "--against", self.source)
            else:
                self.assertEqual(len(report["lost"]), 1)
                self.one_error_line(outcome, names=self.map, says="lost")
        self.assertTrue(all(outcomes.values()), outcomes)
        write(self.map, whole[: len(whole) // 2])
        self.fails(DAMAGED, "repair", self.map, "-o", self.path("g.mapc"), says="no commit")
        self.assertFalse(self.path("g.mapc").exists())


if __name__ == "__main__":
    unittest.main()
