# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes, meshes and levels of detail from archives."""
import json
import struct
import unittest

from clouds import RGB, XYZ, Cloud, pcd_bytes, positions, read_pcd, room, write
from program import BAD_INPUT, USAGE, ProgramTest, run


def read_mesh(path):
    """Vertices and faces of a binary PLY mesh."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    head = data[:end].decode().splitlines()
    count = {line.split()[1]: int(line.split()[2]) for line in head if line.startswith("element")}
    number = "d" if "property double x" in head else "f"
    vertex = struct.Struct("<" + 3 * number + ("BBB" if "property uchar red" in head else ""))
    face = struct.Struct("<BIII")
    assert len(data) == end + vertex.size * count["vertex"] + face.size * count["face"]
    vertices = list(vertex.iter_unpack(data[end:end + vertex.size * count["vertex"]]))
    return vertices, list(face.iter_unpack(data[end + vertex.size * count["vertex"]:]))


class Surfaces(ProgramTest):
    def setUp(self):
        super().setUp()
        # Without clutter: a floor and two walls.
        rows = [r for r in room(34000, RGB, size=(3, 2, 1.5), noise=0.003).rows if min(map(abs, r[:3])) < 0.012]
        self.cloud = Cloud(RGB, rows)
        self.source = write(self.path("room.pcd"), pcd_bytes(self.cloud))
        self.map = self.compress(self.source, "--rms", 0.014, "--codec", "surface", "--tile-size", 1.5, "--color-error", 100)

    def planes(self, *flags):
        out = self.path("planes.json")
        report = self.succeeds("decompress", self.map, "-o", out, "--as", "planes", "--json", "--force", *flags).json
        return report, json.loads(out.read_text())

    def test_planes(self):
        report, found = self.planes()
        self.assertEqual(report["planes"], len(found["planes"]))
        self.assertEqual(found["map_points"], len(self.cloud.rows))
        self.assertGreater(found["plane_points"], 0.95 * found["map_points"])
        self.assertEqual(found["plane_points"], sum(p["points"] for p in found["planes"]))
        largest = found["planes"][:3]
        self.assertEqual(sorted(max(range(3), key=lambda d: abs(p["normal"][d])) for p in largest), [0, 1, 2])
        for p in largest:
            self.assertAlmostEqual(sum(v * v for v in p["normal"]), 1, places=6)
            self.assertLess(abs(p["offset"]), 0.02)
            self.assertLess(p["rms"], 0.02)
            self.assertEqual(len(p["color"]), 3)
            for corner in p["polygon"]:
                self.assertAlmostEqual(sum(a * b for a, b in zip(corner, p["normal"])), p["offset"], delta=1e-3)
        area = {max(range(3), key=lambda d: abs(p["normal"][d])): p["area"] for p in largest}
        for axis, expected in ((0, 3), (1, 4.5), (2, 6)):
            self.assertAlmostEqual(area[axis] / expected, 1, delta=0.25)
        self.assertNotIn("cylinders", found)

    def test_planes_are_the_same_on_any_threads(self):
        outs = []
        for threads in (1, 2, 8):
            self.planes("--threads", threads)
            outs.append(self.path("planes.json").read_bytes())
        self.assertEqual(outs[0], outs[1])
        self.assertEqual(outs[0], outs[2])

    def test_surfaces_with_color_are_the_same_on_any_threads(self):
        for promise in (("--rms", 0.014, "--codec", "surface", "--color-error", 40), ("--rms", 0.02), ("--target-bpp", 1.5)):
            flags = (*promise, "--tile-size", 1)
            one, *others = [self.compress(self.source, *flags, "--threads", t, name=f"{t}.mapc").read_bytes() for t in (1, 2, 8)]
            for other in others:
                self.assertEqual(one, other, promise)
            report = self.succeeds("info", self.path("1.mapc"), "--json").json
            self.assertGreater(report["tiles"], 4)
            clouds = [self.decompress(self.path("1.mapc"), "--threads", t, name=f"{t}.pcd").read_bytes() for t in (1, 2, 8)]
            self.assertEqual(clouds[0], clouds[1])
            self.assertEqual(clouds[0], clouds[2])
            for t in (1, 2, 8):
                self.path(f"{t}.mapc").unlink()
                self.path(f"{t}.pcd").unlink()

    def test_cylinders_of_a_room_are_none(self):
        outcome = run("decompress", self.map, "-o", self.path("c.json"), "--as", "planes", "--cylinders")
        if outcome.code != 0 and "CGAL" in outcome.err:
            self.skipTest("built without CGAL")
        self.assertEqual(outcome.code, 0, outcome)
        self.assertEqual(json.loads(self.path("c.json").read_text())["cylinders"], [])

    def test_mesh(self):
        out = self.path("room.ply")
        report = self.succeeds("decompress", self.map, "-o", out, "--as", "mesh", "--json").json
        vertices, faces = read_mesh(out)
        self.assertEqual((len(vertices), len(faces)), (report["vertices"], report["faces"]))
        area = 0
        for three, *face in faces:
            self.assertEqual(three, 3)
            a, b, c = (vertices[i][:3] for i in face)
            u, v = ([q - p for p, q in zip(a, x)] for x in (b, c))
            area += 0.5 * sum((u[i - 2] * v[i - 1] - u[i - 1] * v[i - 2]) ** 2 for i in range(3)) ** 0.5
        self.assertAlmostEqual(area / 13.5, 1, delta=0.2)
        # Cells at an edge reach beyond it.
        off = [v for v in vertices if min(map(abs, v[:3])) > 0.1]
        self.assertLess(len(off), 0.05 * len(vertices))
        self.assertEqual(len(vertices[0]), 6)

    def test_mesh_as_text_and_of_a_box(self):
        out = self.path("part.ply")
        self.succeeds("decompress", self.map, "-o", out, "--as", "mesh", "--ascii", "--box", "0,0,-1,2,2,1")
        self.assertIn("format ascii", out.read_text())

    def test_levels(self):
        info = self.succeeds("info", self.map, "--json").json
        levels = info["levels"]
        self.assertGreater(len(levels), 3)
        self.assertEqual([l["level"] for l in levels], list(range(len(levels))))
        self.assertEqual(levels[0]["cell_m"], info["tile_size_m"])
        for a, b in zip(levels, levels[1:]):
            self.assertLessEqual(b["rms_m"], 1.05 * a["rms_m"])
            self.assertLessEqual(a["byte_share"], b["byte_share"])
        self.assertEqual(levels[-1]["byte_share"], 1)
        original = positions(self.cloud)
        for level in levels:
            out = self.decompress(self.map, "--level", level["level"])
            cloud = read_pcd(out)
            self.assertEqual(cloud.fields, XYZ)
            self.assertEqual(len(cloud.rows), len(original))
            measured = self.succeeds("evaluate", self.source, out, "--json").json["rms_m"]
            self.assertAlmostEqual(measured / level["rms_m"], 1, delta=0.3)
        self.assertEqual(positions(read_pcd(out)), positions(read_pcd(self.decompress(self.map, name="full.pcd"))))

    def test_levels_of_points(self):
        archive = self.compress(self.source, "--max-error", 0.01, name="points.mapc")
        levels = self.succeeds("info", archive, "--json").json["levels"]
        self.assertGreater(len(levels), 3)
        sizes = []
        for level in (1, 4, len(levels) - 1):
            sizes.append(len(set(positions(read_pcd(self.decompress(archive, "--level", level))))))
        self.assertLess(sizes[0], sizes[1])
        self.assertLess(sizes[1], sizes[2])

    def test_maps_without_surfaces(self):
        archive = self.compress(self.source, "--lossless", name="lossless.mapc")
        for form, name in (("mesh", "x.ply"), ("planes", "x.json")):
            self.fails(BAD_INPUT, "decompress", archive, "-o", self.path(name), "--as", form, names=archive, says="surfaces")
        self.fails(BAD_INPUT, "decompress", archive, "-o", self.path("x.pcd"), "--level", 2, names=archive, says="levels")
        self.assertEqual([n for n in self.listing() if n.startswith("x.")], [])
        self.assertEqual(self.succeeds("info", archive, "--json").json["levels"], [])

    def test_what_does_not_go_together(self):
        for flags in (("--as", "mesh", "--level", 3), ("--as", "planes", "--level", 3), ("--as", "mesh", "--cylinders"),
                      ("--cylinders",), ("--as", "planes", "--binary-compressed"), ("--tolerance", 0.1)):
            self.fails(USAGE, "decompress", self.map, "-o", self.path("x.ply"), *flags)
        self.fails(USAGE, "decompress", self.map, "-o", self.path("x.pcd"), "--as", "mesh", says="ply")
        for bad in ("-1", "99", "x"):
            self.fails(USAGE, "decompress", self.map, "-o", self.path("x.pcd"), "--level", bad)
        self.fails(BAD_INPUT, "decompress", self.map, "-o", self.path("x.ply"), "--as", "mesh", "--box",
                   "90,90,90,91,91,91", names=self.map)
        self.assertEqual([n for n in self.listing() if n.startswith("x.")], [])


if __name__ == "__main__":
    unittest.main()
