# SPDX-License-Identifier: GPL-3.0-or-later
"""The registration example on a made-up room: each method finds where a scan was taken."""
import math
import os
import subprocess
import unittest

import clouds
from program import ProgramTest

LOCALIZE = os.environ.get("LOCALIZE", "build/release/bin/localize")
YAW, AT = math.radians(25), (3.2, 2.1, 1.1)  # T_map_scan


def seen_from(point):
    x, y, z = (a - b for a, b in zip(point, AT))
    c, s = math.cos(YAW), math.sin(YAW)
    return clouds.to_float32(c * x + s * y), clouds.to_float32(-s * x + c * y), clouds.to_float32(z)


def localize(*arguments):
    done = subprocess.run([LOCALIZE, *map(str, arguments)], capture_output=True, timeout=300, text=True)
    return done.returncode, dict(line.split(" ", 1) for line in done.stdout.splitlines()), done.stderr


class Localize(ProgramTest):
    def setUp(self):
        super().setUp()
        room = clouds.room(40000, clouds.XYZ, seed=1, noise=0.002)
        scan = clouds.Cloud(clouds.XYZ, [seen_from(p) for p in clouds.room(6000, clouds.XYZ, seed=2, noise=0.002).rows])
        self.room = clouds.write(self.path("room.pcd"), clouds.pcd_bytes(room))
        self.scan = clouds.write(self.path("scan.pcd"), clouds.pcd_bytes(scan))
        self.guess = ["--guess", AT[0] + 0.15, AT[1] - 0.1, AT[2] + 0.05, 1, -1, math.degrees(YAW) + 3, "--reach", 0.6]

    def found(self, archive, method, within_m=0.005):
        code, values, err = localize(archive, self.scan, *self.guess, "--method", method)
        if "built without" in err:
            self.skipTest(err)
        self.assertEqual(code, 0, err)
        off = math.dist([float(v) for v in values["position_m"].split()], AT)
        yaw = 2 * math.asin(float(values["rotation_xyzw"].split()[2]))
        self.assertLess(off, within_m, values)
        self.assertLess(abs(yaw - YAW), 0.6 * within_m, values)
        self.assertEqual(values["converged"], "yes")
        return values

    def test_stored_patches_without_points(self):
        archive = self.compress(self.room, "--rms", 0.005, "--codec", "surface")
        values = self.found(archive, "patches")
        self.assertEqual(values["map_points"], "0")
        self.assertGreater(int(values["map_patches"]), 20)

    def test_planes_of_points(self):
        self.found(self.compress(self.room, "--max-error", 0.005), "points")

    def test_gicp(self):
        self.found(self.compress(self.room, "--max-error", 0.005), "gicp")

    def test_ndt(self):
        # Its cells are wide: it finds the place, not the millimetre.
        self.found(self.compress(self.room, "--max-error", 0.005), "ndt", within_m=0.03)

    def test_stored_patches_from_a_guess_that_is_far_off(self):
        archive = self.compress(self.room, "--rms", 0.005, "--codec", "surface")
        self.guess = ["--guess", AT[0] + 0.5, AT[1] - 0.4, AT[2], 0, 0, math.degrees(YAW) + 5, "--reach", 1.0]
        self.found(archive, "patches")

    def test_says_what_is_wrong(self):
        archive = self.compress(self.room, "--max-error", 0.005)
        code, _, err = localize(archive, self.scan, *self.guess, "--method", "patches")
        self.assertEqual(code, 1)
        self.assertIn("no stored surfaces", err)
        code, _, err = localize(archive, self.scan, *self.guess, "--method", "points", "--memory", 0.01)
        self.assertEqual(code, 1)
        self.assertIn("budget", err)
        self.assertEqual(localize(archive)[0], 2)
        self.assertEqual(localize(self.path("none.mapc"), self.scan)[0], 1)


if __name__ == "__main__":
    unittest.main()
