#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Adds golden archives: small maps whose decoded points must never change.

Usage: make_golden.py MAPCODEC_PROGRAM [--replace]
Makes the clouds of CLOUDS by rule, compresses each, goes through the changes of HISTORIES, and writes tests/golden/NAME.mapc and its entry in hashes.json, as
tests/support/read_tile.py decodes it. Archives that are there already are left alone: what is tested is that later
versions decode them, not that later versions write the same bytes. Until format 1.0 --replace makes all of them anew
after a deliberate change of the format; from 1.0 on files are only added, never rewritten. Standard library only.
"""
import argparse
import json
import math
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import read_tile  # noqa: E402

NAN, INFINITY = float("nan"), float("inf")
PCD_TYPE = {"f": ("F", 4), "d": ("F", 8), "I": ("U", 4), "H": ("U", 2), "B": ("U", 1), "b": ("I", 1), "h": ("I", 2),
            "i": ("I", 4)}


def pcd(fields, rows):
    """fields: (name, struct code) each."""
    head = (f"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {' '.join(n for n, _ in fields)}\n"
            f"SIZE {' '.join(str(PCD_TYPE[c][1]) for _, c in fields)}\n"
            f"TYPE {' '.join(PCD_TYPE[c][0] for _, c in fields)}\nCOUNT {' '.join('1' for _ in fields)}\n"
            f"WIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n")
    packer = struct.Struct("<" + "".join(c for _, c in fields))
    return head.encode() + b"".join(packer.pack(*row) for row in rows)


def las(scale, offset, points):
    """LAS 1.2, point format 2. points: (X, Y, Z, intensity, r, g, b), integers."""
    lattice = [[p[d] for p in points] for d in range(3)]
    bounds = [v * scale + offset[d] for d in range(3) for v in (max(lattice[d]), min(lattice[d]))]
    head = struct.pack("<4sHHIHH8sBB32s32sHHHIIBHI5I3d3d6d", b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, 2, b"made by rule",
                       b"make_golden.py", 1, 2026, 227, 227, 0, 2, 26, len(points), len(points), 0, 0, 0, 0,
                       scale, scale, scale, *offset, *bounds)
    return head + b"".join(struct.pack("<3iHBBbBH3H", *p[:4], 0x09, 2, 0, 0, 7, *p[4:]) for p in points)


def room(r, count, offset=(0, 0, 0), noise=0.004):
    """Points of a floor, two walls and the air between, each with a colour and a brightness that follow the place."""
    for _ in range(count):
        p = [r.random() * side for side in (4, 3, 2)]
        kind = r.random()
        if kind < 0.9:
            p[2 if kind < 0.4 else 0 if kind < 0.65 else 1] = (r.random() - 0.5) * noise
        rgb = [int(120 + 60 * (p[d] % 1.5) + 8 * r.random()) for d in range(3)]
        yield [a + b for a, b in zip(p, offset)], rgb, 10 * p[0] + r.random()


def packed(rgb):
    return rgb[0] << 16 | rgb[1] << 8 | rgb[2]


XYZ = (("x", "f"), ("y", "f"), ("z", "f"))
XYZ_DOUBLE = (("x", "d"), ("y", "d"), ("z", "d"))
COLORED = XYZ + (("rgb", "I"), ("intensity", "f"))


def colored_room(count=900):
    return pcd(COLORED, [(*p, packed(c), i) for p, c, i in room(random.Random(1), count)])


def crowded_room():
    """Many points a voxel, so that counts are large."""
    return pcd(XYZ, [tuple(p) for p, _, _ in room(random.Random(2), 3000, noise=0.001)] + [(1, 1, 1)] * 300)


def dense_room():
    """Many points a leaf: coarse counts, wedges."""
    return pcd(XYZ, [tuple(p) for p, _, _ in room(random.Random(10), 12000, noise=0.002)])


def noisy_room():
    """Walls as thick as the asked error: blocks of voxels and thick leaves."""
    return pcd(XYZ, [tuple(p) for p, _, _ in room(random.Random(11), 9000, noise=0.3)])


def dust():
    """No surface anywhere: the lowest levels of the tree are noise."""
    r = random.Random(3)
    return pcd(XYZ, [[r.random() * 5 for _ in range(3)] for _ in range(700)])


def utm_room():
    rows = room(random.Random(4), 700, offset=(456789.125, 5428123.5, 312.75))
    return pcd(XYZ_DOUBLE + (("intensity", "f"),), [(*p, i) for p, _, i in rows])


def odd_scan():
    """Missing returns, infinities, negative zeros, repeats, and a channel of each kind."""
    r, rows = random.Random(5), []
    for k, (p, c, i) in enumerate(room(r, 500, offset=(-1, -1, -0.5))):
        if k % 17 == 0:
            p = [NAN, NAN, NAN]
        elif k % 41 == 0:
            p = [p[0], INFINITY, -INFINITY]
        elif k % 23 == 0:
            p = [0.0, -0.0, p[2] * 1e-20]
        elif k % 11 == 0:
            p = list(rows[-1][:3])
        label, tilt = r.choice((1, 2, 2, 2, 6)), r.randrange(-100, 100)
        rows.append((*p, packed(c), i, k % 16, label, tilt, -k * k, 1.6e9 + k / 8192))
    fields = COLORED + (("ring", "H"), ("label", "B"), ("tilt", "b"), ("range", "i"), ("time", "d"))
    return pcd(fields, rows)


def utm_decimals():
    """Doubles that were millimetres in a text, some of which are not."""
    rows = []
    for k, (p, _, _) in enumerate(room(random.Random(6), 600, offset=(-456789, 5428123, 312))):
        rows.append([v if k % 150 == 0 else round(v, 3) for v in p])
    return pcd(XYZ_DOUBLE, rows)


def text_scan():
    """Float32 numbers that were decimals in a text, and scalars on lattices of several kinds, with a few exceptions."""
    r, rows = random.Random(8), []
    for k, (p, _, i) in enumerate(room(r, 500, offset=(-2, 1, 0))):
        place = [-0.0, -0.0, 1e-30] if k % 125 == 60 else [round(v, 2) for v in p]
        time = NAN if k % 90 == 45 else round(1000 + k * 0.125 + r.randrange(9) * 0.001, 3)
        product = struct.unpack("f", struct.pack("f", int(i * 40)))[0] * struct.unpack("f", struct.pack("f", 0.01))[0]
        rows.append((*place, r.choice((3, 900, 70000, 4100000)), time, product))
    return pcd(XYZ + (("kind", "I"), ("time", "d"), ("range", "f")), rows)


def crowded_colors():
    """Points that share a voxel, each of its own colour."""
    r = random.Random(9)
    return pcd(COLORED[:4], [(*p, packed([v + r.randrange(60) for v in c])) for p, c, _ in room(r, 1500, noise=0.001)])


def pile():
    """A voxel with more points than twelve bits count."""
    return pcd(XYZ, [(1, 1, 1)] * 9000 + [(k, 1, k % 3) for k in range(20)] + [(2, 2, 2)] * 5000)


def survey():
    offset = (300000.0, 4000000.0, 0.0)
    points = [(*(int(v * 1000) for v in p), int(i * 50), *(257 * v for v in c))
              for p, c, i in room(random.Random(7), 600, offset=(1, 2, 3))]
    return las(0.001, offset, points)


# name: (name of the input, its maker, flags)
def cells_of_a_hill(r):
    """Voxels of a hill and the free air above: place -> log-odds and colour. More than sixteen values are occupied ones."""
    cells = {}
    for x in range(30):
        for y in range(22):
            top = int(8 + 3 * math.sin(x / 4) + 2 * math.cos(y / 3))
            shade = 90 + 4 * x + r.randrange(9)
            cells[x, y, top] = 0.85 * min(20, 1 + int(r.expovariate(0.4))), (shade, shade - 40 + r.randrange(4), 5 * y)
            for z in range(top + 1, top + 5):
                cells[x, y, z] = -0.4 * (5 if z > top + 2 else 1 + r.randrange(3)), (255, 255, 255)
    return {tuple(32768 - 9 + v for v in place): cell for place, cell in cells.items()}


def tree_of(cells, height):
    """(log-odds, colour, children or None): a leaf where eight alike meet, else what OctoMap makes of the children."""
    if height == 0:
        (value, rgb), = cells.values()
        return value, rgb, None
    parts = [{} for _ in range(8)]
    for place, cell in cells.items():
        parts[sum((v >> (height - 1) & 1) << d for d, v in enumerate(place))][place] = cell
    children = [tree_of(p, height - 1) if p else None for p in parts]
    if all(c and c[2] is None and c == children[0] for c in children):
        return children[0]
    there = [c for c in children if c]
    shown = [c[1] for c in there if c[1] != (255, 255, 255)]
    mean = tuple(sum(c[d] for c in shown) // len(shown) for d in range(3)) if shown else (255, 255, 255)
    return max(c[0] for c in there), mean, children


def octree(kind, odd_root=False):
    """A file of OctoMap's. kind: "bt", "OcTree" or "ColorOcTree"; odd_root: an inner node that is not what its children say."""
    value, rgb, children = tree_of(cells_of_a_hill(random.Random(8)), 16)
    nodes, body = 0, bytearray()

    def ot(node):
        nonlocal nodes
        nodes += 1
        body.extend(struct.pack("<f", node[0]) + (bytes(node[1]) if kind == "ColorOcTree" else b""))
        body.append(sum(1 << i for i, c in enumerate(node[2] or []) if c))
        for c in node[2] or []:
            if c:
                ot(c)

    def bt(node):
        nonlocal nodes
        nodes += 1 + sum(1 for c in node[2] if c and c[2] is None)
        body.extend(struct.pack("<H", sum((3 if c[2] else 1 if c[0] < 0 else 2) << 2 * i for i, c in enumerate(node[2]) if c)))
        for c in node[2]:
            if c and c[2]:
                bt(c)

    (bt if kind == "bt" else ot)((value + (1 if odd_root else 0), rgb, children))
    what, name = ("binary ", "OcTree") if kind == "bt" else ("", kind)
    return (f"# Octomap OcTree {what}file\n# (feel free to add / change comments, but leave the first line as it is!)\n#\n"
            f"id {name}\nsize {nodes}\nres 0.1\ndata\n").encode() + bytes(body)


CLOUDS = {
    "points_fast": ("a.pcd", colored_room, "--max-error 0.005 --effort fast"),
    "points_default": ("a.pcd", colored_room, "--max-error 0.005"),
    "points_high": ("a.pcd", colored_room, "--rms 0.01 --codec points --effort high --color-error 3"),
    "points_exact_channels": ("a.pcd", colored_room, "--rms 0.01 --codec points --color-error 0"),
    "points_tiles": ("a.pcd", colored_room, "--max-error 0.02 --tile-size 2"),
    "points_counts": ("a.pcd", crowded_room, "--max-error 0.02"),
    "points_no_counts": ("a.pcd", crowded_room, "--rms 0.02 --no-counts"),
    "points_dust": ("a.pcd", dust, "--max-error 0.0005"),
    "points_one": ("a.pcd", lambda: pcd(COLORED, [(1, 2, 3, 0x102030, 0.5)]), "--max-error 0.01"),
    "points_crowded_colors": ("a.pcd", crowded_colors, "--max-error 0.05 --color-error 2"),
    "points_crowded_exact": ("a.pcd", crowded_colors, "--max-error 0.05 --color-error 0"),
    "points_pile": ("a.pcd", pile, "--max-error 0.05"),
    "points_utm": ("a.pcd", utm_room, "--max-error 0.001"),
    "points_survey": ("a.las", survey, "--rms 0.005 --codec points"),
    "surface_sparse": ("a.pcd", crowded_room, "--rms 0.02 --codec surface"),
    "surface_coarse": ("a.pcd", dense_room, "--rms 0.03 --codec surface"),
    "surface_noisy": ("a.pcd", noisy_room, "--rms 0.06 --codec surface --effort high"),
    "surface_colors": ("a.pcd", colored_room, "--rms 0.05 --codec surface --color-error 12"),
    "surface_coarse_colors": ("a.pcd", colored_room, "--rms 0.05 --codec surface --color-error 20"),
    "surface_tiles": ("a.pcd", colored_room, "--rms 0.05 --codec surface --channels none --tile-size 2"),
    "surface_utm": ("a.pcd", utm_room, "--rms 0.05 --codec surface"),
    "surface_pile": ("a.pcd", pile, "--rms 0.05 --codec surface"),
    "lossless_odd": ("a.pcd", odd_scan, "--lossless"),
    "lossless_odd_order": ("a.pcd", odd_scan, "--lossless --keep-order --effort high"),
    "lossless_text": ("a.pcd", text_scan, "--lossless"),
    "lossless_utm": ("a.pcd", utm_decimals, "--lossless"),
    "lossless_utm_floats": ("a.pcd", utm_room, "--lossless --effort fast"),
    "lossless_survey": ("a.las", survey, "--lossless"),
    "octree_binary": ("a.bt", lambda: octree("bt"), ""),
    "octree_log_odds": ("a.ot", lambda: octree("OcTree"), ""),
    "octree_colors": ("a.ot", lambda: octree("ColorOcTree"), ""),
    "octree_odd_root": ("a.ot", lambda: octree("ColorOcTree", odd_root=True), ""),
}


def moved_room():
    rows = [(*p, packed(c), i) for p, c, i in room(random.Random(12), 500, offset=(1.5, 0, 0))]
    return pcd(COLORED, rows)


# name: (command line that makes the map, then those that change it; MAP, A and B stand for files)
HISTORIES = {
    "living_pending": ("update MAP A --create --rms 0.05 --tile-size 2", "update MAP B", "remove MAP --box 0,0,0,1,1,1"),
    "living_folded": ("compress A -o MAP --rms 0.05 --codec surface --color-error 12", "update MAP B", "compact MAP",
                      "remove MAP --where intensity:0:5", "update MAP A --all-points", "remove MAP --sphere 1,1,0,0.5"),
    "living_hashes": ("compress A -o MAP --max-error 0.01 --tile-size 2", "update MAP B", "snapshot MAP both",
                      "compact MAP --hashes on", "crop MAP --box 0,0,0,3,3,3"),
    "living_lossless": ("update MAP A --create --lossless", "update MAP B", "compact MAP"),
}


def make_history(program, name, folder):
    files = {"A": folder / "a.pcd", "B": folder / "b.pcd", "MAP": folder / "map.mapc"}
    files["A"].write_bytes(colored_room())
    files["B"].write_bytes(moved_room())
    files["MAP"].unlink(missing_ok=True)
    for line in HISTORIES[name]:
        threads = [] if line.startswith("snapshot") else ["--threads", "1"]
        subprocess.run([program, *(files.get(word, word) for word in line.split()), *threads], check=True,
                       stdout=subprocess.DEVNULL, env={"SOURCE_DATE_EPOCH": "0"})
    (HERE / f"{name}.mapc").write_bytes(files["MAP"].read_bytes())
    return read_tile.digest(files["MAP"].read_bytes())


def make(program, name, folder):
    if name in HISTORIES:
        return make_history(program, name, folder)
    input_name, maker, flags = CLOUDS[name]
    source, archive = folder / input_name, HERE / f"{name}.mapc"
    source.write_bytes(maker())
    subprocess.run([program, "compress", source, "-o", archive, *flags.split(), "--threads", "1", "--progress", "none",
                    "--force"], check=True, stdout=subprocess.DEVNULL)
    return read_tile.digest(archive.read_bytes())


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program")
    arguments.add_argument("--replace", action="store_true")
    options = arguments.parse_args()
    listing = HERE / "hashes.json"
    hashes = json.loads(listing.read_text()) if listing.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        for name in [*CLOUDS, *HISTORIES]:
            if options.replace or name not in hashes:
                hashes[name] = make(options.program, name, pathlib.Path(folder))
                listing.write_text(json.dumps(hashes, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
