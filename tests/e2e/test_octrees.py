# SPDX-License-Identifier: GPL-3.0-or-later
"""Octrees of OctoMap: in and out, a box, updates, beside points, damaged."""
import os
import struct
import subprocess
import unittest
from pathlib import Path

from clouds import RGB, pcd_bytes, room, write
from program import BAD_INPUT, CANNOT_WRITE, DIFFERENCE, USAGE, ProgramTest

REAL = Path("/usr/share/doc/liboctomap-dev/examples/data/geb079.bt")
HEAD = b"# Octomap OcTree %sfile\n# (feel free to add / change comments, but leave the first line as it is!)\n#\nid %s\nsize %d\nres 0.1\ndata\n"


def small_bt(leaf=1):
    """A chain of inner nodes down to voxels, by rule: one in three children a leaf."""
    nodes, count = [], 1

    def node(height):
        nonlocal count
        at, word, inner = len(nodes), 0, []
        nodes.append(0)
        for child in range(8):
            cell = 3 if height > 1 and child == (height * 5) % 8 else (leaf if (child + height) % 3 == 0 else 0)
            word |= cell << 2 * child
            count += cell != 0
            inner += [child] if cell == 3 else []
        nodes[at] = word
        for _ in inner:
            node(height - 1)

    node(16)
    return HEAD % (b"binary ", b"OcTree", count) + b"".join(struct.pack("<H", n) for n in nodes)


def small_ot():
    """Two levels below the root, coloured."""
    def leaf(value, rgb):
        return struct.pack("<f3BB", value, *rgb, 0)
    inner = struct.pack("<f3BB", 0.85, 10, 20, 30, 3) + leaf(0.85, (10, 20, 30)) + leaf(-0.4, (255, 255, 255))
    return HEAD % (b"", b"ColorOcTree", 5) + struct.pack("<f3BB", 2.0, 10, 20, 30, 0b101) + inner + leaf(2.0, (10, 20, 30))


class Octrees(ProgramTest):
    def test_files_come_back_as_they_were(self):
        sources = {"a.bt": small_bt(), "b.ot": small_ot()}
        if REAL.exists():
            sources["c.bt"] = REAL.read_bytes()
        for name, data in sources.items():
            source = write(self.path(name), data)
            archive = self.compress(source, name=name + ".mapc")
            out = self.decompress(archive, name="out" + name[-3:])
            self.assertEqual(out.read_bytes(), data, name)
            self.succeeds("verify", archive, "--against", source)
            info = self.succeeds("info", archive, "--json").json
            self.assertEqual(info["codecs"]["occupancy"]["points"], info["points"])
            self.succeeds("decompress", archive, "-o", self.path("cells.ply"), "--force")

    def test_the_size_that_a_real_tree_takes(self):
        if not REAL.exists():
            self.skipTest("liboctomap-dev has no examples here")
        self.assertLess(self.compress(REAL).stat().st_size, 100_000)

    def test_a_box(self):
        archive = self.compress(write(self.path("a.bt"), small_bt()))
        self.decompress(archive, "--box", "-1,-1,-1,1,1,1", name="part.bt")
        self.fails(BAD_INPUT, "decompress", archive, "-o", self.path("none.bt"), "--box", "9e5,9e5,9e5,9.1e5,9.1e5,9.1e5")
        self.assertFalse(self.path("none.bt").exists())

    def test_updates(self):
        first, second = write(self.path("a.bt"), small_bt(1)), write(self.path("b.bt"), small_bt(2))
        archive = self.compress(first)
        before = archive.read_bytes()
        self.assertFalse(self.succeeds("update", archive, first, "--json").json["committed"])
        self.assertEqual(archive.read_bytes(), before)
        self.assertEqual(self.succeeds("update", archive, second, "--json").json["revision"], 2)
        self.succeeds("verify", archive, "--against", second)
        self.fails(DIFFERENCE, "verify", archive, "--against", first)
        self.decompress(archive, "--revision", 1, name="old.bt")
        self.assertEqual(self.path("old.bt").read_bytes(), first.read_bytes())
        self.succeeds("compact", archive)
        self.succeeds("verify", archive, "--against", second)
        full = self.compress(write(self.path("c.ot"), small_ot()), name="full.mapc")
        self.fails(USAGE, "update", full, first)  # log-odds are not made up

    def test_points_and_an_octree_in_one_archive(self):
        points = write(self.path("in.pcd"), pcd_bytes(room(20000, RGB)))
        archive = self.compress(points, "--max-error", 0.01)
        plain = self.decompress(archive).read_bytes()
        octree = write(self.path("a.bt"), small_bt())
        self.succeeds("update", archive, octree)
        self.assertEqual(self.decompress(archive).read_bytes(), plain)
        self.succeeds("verify", archive)
        self.succeeds("verify", archive, "--against", octree)
        self.succeeds("verify", archive, "--against", points)
        self.assertEqual(self.decompress(archive, name="out.bt").read_bytes(), octree.read_bytes())
        self.succeeds("update", archive, write(self.path("b.bt"), small_bt(2)))
        self.succeeds("compact", archive)
        self.succeeds("verify", archive, "--against", self.path("b.bt"))
        self.succeeds("update", archive, write(self.path("more.pcd"), pcd_bytes(room(5000, RGB))))
        self.succeeds("remove", archive, "--box", "0,0,0,1,1,1")
        self.succeeds("verify", archive, "--against", self.path("b.bt"))

    def test_points_as_an_octree(self):
        archive = self.compress(write(self.path("in.pcd"), pcd_bytes(room(5000, RGB))), "--max-error", 0.01)
        without = self.decompress(archive, "--as", "bt", "--resolution", 0.2, name="a.bt").stat().st_size
        with_rays = self.decompress(archive, "--as", "bt", "--resolution", 0.2, "--origin", "1,1,1", name="b.bt")
        self.assertGreater(with_rays.stat().st_size, without)
        self.compress(with_rays, name="again.mapc")
        self.fails(USAGE, "decompress", archive, "-o", self.path("x.pcd"), "--as", "bt")

    def test_rays_begin_at_corrected_poses(self):
        scans = [write(self.path(n), pcd_bytes(room(3000, RGB))) for n in ("a.pcd", "b.pcd")]
        wrong, right = ("2,0,0,0,0,0,1", "5,1,0.5,0,0,0.6,0.8"), ("2,0.3,0,0,0,0,1", "4,1,0,0,0,0.8,0.6")

        def map_of(name, poses):
            archive = self.path(name)
            for i, (scan, pose) in enumerate(zip(scans, poses)):
                self.succeeds("update", archive, scan, "--create", "--max-error", 0.01, "--submap", f"s{i}", "--pose", pose)
            return archive

        def cells(archive, name):
            return self.decompress(archive, "--as", "bt", "--resolution", 0.2, name=name).read_bytes()

        moved = map_of("moved.mapc", wrong)
        before = cells(moved, "before.bt")
        for i, pose in enumerate(right):
            self.succeeds("pose", moved, "--submap", f"s{i}", "--pose", pose)
        after = cells(moved, "after.bt")
        self.assertNotEqual(before, after)
        self.assertEqual(after, cells(map_of("straight.mapc", right), "straight.bt"))

    def test_an_octree_cannot_be_moved(self):
        archive = self.compress(write(self.path("in.pcd"), pcd_bytes(room(2000, RGB))))
        octree = write(self.path("a.bt"), small_bt())
        self.succeeds("update", archive, octree)
        for pose in ("1,0,0,0,0,0,1", "0,0,0,0,0,1,0"):
            self.fails(BAD_INPUT, "pose", archive, "--submap", "octree", "--pose", pose, says="--as bt")
        self.succeeds("pose", archive, "--submap", "octree", "--pose", "0,0,0,0,0,0,1")
        self.assertEqual(self.decompress(archive, name="out.bt").read_bytes(), octree.read_bytes())

    def test_merged_and_flattened(self):
        points, octree = write(self.path("in.pcd"), pcd_bytes(room(2000, RGB))), write(self.path("a.bt"), small_bt())
        both = self.compress(points, name="both.mapc")
        self.succeeds("update", both, octree)
        self.fails(BAD_INPUT, "update", both, points, "--submap", "octree", says="takes no points")
        grown = self.compress(points, name="grown.mapc")
        self.succeeds("merge", grown, both)
        self.succeeds("flatten", both, "-o", self.path("flat.mapc"))
        for archive in (grown, self.path("flat.mapc")):
            self.succeeds("verify", archive, "--against", octree)
            self.assertGreater(self.succeeds("info", archive, "--json").json["points"], 1999)

    def test_bad_files(self):
        good = small_bt()
        for name, data in {"cut.bt": good[:-3], "count.bt": good.replace(b"size ", b"size 9"), "empty.bt": b"",
                           "head.bt": good[:40], "kind.ot": small_ot().replace(b"ColorOcTree", b"OtherOcTree"),
                           "res.bt": good.replace(b"res 0.1", b"res nan")}.items():
            source = write(self.path(name), data)
            self.fails(BAD_INPUT, "compress", source, "-o", self.path("m.mapc"), names=name)
            self.assertFalse(self.path("m.mapc").exists())

    def test_no_octree_to_write(self):
        archive = self.compress(write(self.path("in.pcd"), pcd_bytes(room(1000, RGB))))
        self.fails(BAD_INPUT, "decompress", archive, "-o", self.path("x.bt"), says="octree")
        octree = self.compress(write(self.path("a.bt"), small_bt()), name="o.mapc")
        self.fails(CANNOT_WRITE, "decompress", octree, "-o", self.path("nowhere") / "x.bt")


class Example(ProgramTest):
    def test_octomap_program(self):
        program = os.environ.get("OCTOMAP_MAP")
        if not program:
            self.skipTest("built without OctoMap")
        done = subprocess.run([program, self.path("hall.mapc")], capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, 0, done)
        words = done.stdout.split()
        figures = dict(zip(words[::2], map(int, words[1::2])))
        self.assertEqual(figures["wrong"], 0)
        self.assertGreater(figures["changed_keys"], 0)
        self.assertGreater(figures["box_leaves"], 0)


if __name__ == "__main__":
    unittest.main()
