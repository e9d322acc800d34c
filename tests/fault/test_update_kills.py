# SPDX-License-Identifier: GPL-3.0-or-later
"""update and compact are killed at random moments: what was committed is there, whole, and the work goes on.

MAPCODEC_FAULT_KILLS: how often (default 12).
"""
import os
import random
import subprocess
import time
import unittest

from clouds import pcd_bytes, room, write
from program import DONE, ProgramTest, command, run


class Kills(ProgramTest):
    def test_killed_updates_lose_nothing(self):
        r = random.Random(4)
        scans = [write(self.path(f"{i}.pcd"), pcd_bytes(room(6000, seed=i, offset=(3 * i, 0, 0)))) for i in range(6)]
        archive = self.path("map.mapc")
        self.succeeds("update", archive, scans[0], "--create", "--rms", 0.02)
        killed = 0
        for i in range(int(os.environ.get("MAPCODEC_FAULT_KILLS", "12"))):
            before = self.succeeds("info", archive, "--json").json
            work = ("compact", archive) if r.random() < 0.3 else ("update", archive, scans[i % 6], "--all-points")
            child = subprocess.Popen(command(*work), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            time.sleep(r.random() * 0.12)
            child.kill()
            out, err = child.communicate()
            killed += child.returncode < 0
            self.assertIn(child.returncode, (DONE, -9), err)
            verified = run("verify", archive)
            self.assertEqual(verified.code, DONE, f"{work[0]} {i}: {verified}")
            after = self.succeeds("info", archive, "--json").json
            self.assertGreaterEqual(after["revision"], before["revision"])
            self.assertGreaterEqual(after["points"], before["points"])
            if child.returncode == DONE and work[0] == "update":
                self.assertGreater(after["points"], before["points"])
            if after["points"] > 400000:
                self.succeeds("remove", archive, "--box", "-99,-99,-99,99,99,0.5")
        self.assertGreater(killed, 0)
        self.assertEqual([p for p in self.listing() if ".tmp-" in p][1:], [])


if __name__ == "__main__":
    unittest.main()
