# SPDX-License-Identifier: GPL-3.0-or-later
"""Bags and Autoware folders through the program."""
import unittest

import bags
from clouds import pcd_bytes, positions, read_pcd, room, write
from program import BAD_INPUT, CANNOT_WRITE, USAGE, ProgramTest


def drive(scans=4, compression="bz2", points=200):
    """One metre a second along x; in the sensor's frame every scan is the same."""
    scan = [(0.01 * i, 1.0, 0.02 * i, float(i)) for i in range(points)]
    messages = []
    for i in range(scans + 1):
        messages.append(("/tf", 100 + i, bags.transform(100 + i, "map", "lidar", (i, 0, 0))))
    for i in range(scans):
        messages.append(("/points", 100 + i, bags.cloud(100.5 + i, "lidar", scan)))
    return bags.bag_bytes(messages, compression)


class Bags(ProgramTest):
    def setUp(self):
        super().setUp()
        self.bag = write(self.path("drive.bag"), drive())
        self.map = self.path("map.mapc")

    def points(self, *flags):
        return sorted(positions(read_pcd(self.decompress(self.map, *flags))))

    def test_one_command(self):
        out = self.succeeds("compress", self.bag, "-o", self.map, "--lossless", "--json").json
        self.assertEqual(out["points"], 800)
        self.assertEqual([c["name"] for c in out["channels"]], ["intensity"])
        self.assertAlmostEqual(out["bounds"]["min"][0], 0.5, 4)
        self.assertAlmostEqual(out["bounds"]["max"][0], 3.5 + 1.99, 4)
        self.succeeds("verify", self.map, "--against", self.bag)

    def test_poses_none_and_topics(self):
        out = self.succeeds("compress", self.bag, "-o", self.map, "--lossless", "--poses", "none", "--topic", "/points", "--json").json
        self.assertAlmostEqual(out["bounds"]["max"][0], 1.99, 4)
        self.succeeds("verify", self.map, "--against", self.bag, "--poses", "none")

    def test_each_scan_is_a_submap_that_moves(self):
        self.succeeds("update", self.map, self.bag, "--create", "--lossless", "--each-scan")
        info = self.succeeds("info", self.map, "--json").json
        self.assertEqual((info["points"], info["submaps"]), (800, 5))
        before = self.points()
        self.assertAlmostEqual(before[0][0], 0.5, 5)
        self.succeeds("pose", self.map, "--submap", "/points@103.500000000", "--pose", "103.5,0,0,0,0,0,1")
        after = self.points()
        self.assertEqual(before[:400], after[:400])
        self.assertAlmostEqual(after[-1][0], 103.5 + 1.99, 4)

    def test_bad_bags(self):
        whole = drive()
        for cut in (5, 2000, 4200, len(whole) - 10):
            bag = write(self.path("cut.bag"), whole[:cut])
            self.fails(BAD_INPUT, "compress", bag, "-o", self.map, names=bag)
        self.fails(USAGE, "compress", self.bag, "-o", self.map, "--poses", "odometry", says="odometry")
        self.fails(USAGE, "compress", self.bag, "-o", self.map, "--topic", "/rear", says="topic /rear")
        mcap = write(self.path("two.mcap"), b"\x89MCAP0\r\n" + bytes(100))
        self.fails(BAD_INPUT, "compress", mcap, "-o", self.map, names=mcap, says="rosbags-convert")
        self.assertFalse(self.map.exists())


class Autoware(ProgramTest):
    def test_there_and_back(self):
        cloud = write(self.path("room.pcd"), pcd_bytes(room(3000, size=(70, 50, 3))))
        archive = self.compress(cloud, "--lossless")
        folder = self.path("map")
        out = self.succeeds("decompress", archive, "-o", folder, "--as", "autoware", "--tile-size-xy", 25, "--json").json
        self.assertEqual(out["points"], 3000)
        self.assertEqual(out["tiles_written"], len(list((folder / "pointcloud_map.pcd").iterdir())))
        metadata = (folder / "pointcloud_map_metadata.yaml").read_text()
        self.assertIn("x_resolution: 25.0\n", metadata)
        self.assertIn("25_0.pcd: [25, 0]\n", metadata)
        again = self.compress(folder, "--lossless", name="again.mapc")
        self.succeeds("verify", again, "--against", cloud)
        self.fails(CANNOT_WRITE, "decompress", archive, "-o", folder, "--as", "autoware", names=folder, says="exists")
        (folder / "pointcloud_map.pcd" / "25_0.pcd").unlink()
        self.fails(BAD_INPUT, "compress", folder, "-o", self.path("x.mapc"), names=folder, says="25_0.pcd")


if __name__ == "__main__":
    unittest.main()
