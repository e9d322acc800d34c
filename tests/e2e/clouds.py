# SPDX-License-Identifier: GPL-3.0-or-later
"""Clouds made up by rule, and small readers and writers of PCD and PLY written apart from the program's own."""
import random
import struct
from collections import namedtuple

# rows: tuples in the order of fields; fields: (name, struct code)
Cloud = namedtuple("Cloud", "fields rows")

XYZ = (("x", "f"), ("y", "f"), ("z", "f"))
RGB = XYZ + (("rgb", "I"),)
FULL = RGB + (("intensity", "f"), ("ring", "H"))
PCD_TYPE = {"f": ("F", 4), "d": ("F", 8), "I": ("U", 4), "H": ("U", 2), "B": ("U", 1), "i": ("I", 4)}
PLY_TYPE = {"f": "float", "d": "double", "I": "uint", "H": "ushort", "B": "uchar", "i": "int"}


def to_float32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def room(count, fields=FULL, seed=1, offset=(0, 0, 0), size=(8, 6, 3), noise=0.004):
    """A floor, two walls and clutter, with colour that follows the position."""
    r = random.Random(seed)
    rows = []
    for i in range(count):
        p = [r.random() * s for s in size]
        kind = r.random()
        if kind < 0.9:
            axis = 2 if kind < 0.4 else 0 if kind < 0.65 else 1
            p[axis] = r.gauss(0, noise)
        p = [a + b for a, b in zip(p, offset)]
        red, green, blue = (int(127 + 120 * ((p[k] * 0.3) % 1 - 0.5)) for k in range(3))
        extra = {"rgb": red << 16 | green << 8 | blue, "intensity": to_float32(r.random() * 100), "ring": i % 32}
        value = dict(zip("xyz", p), **extra)
        rows.append(tuple(to_float32(value[n]) if c == "f" else value[n] for n, c in fields))
    return Cloud(fields, rows)


def pcd_bytes(cloud, data="binary", points=None, width=None):
    """`points` and `width`: lies to tell in the header."""
    count = len(cloud.rows)
    names = " ".join(n for n, _ in cloud.fields)
    sizes = " ".join(str(PCD_TYPE[c][1]) for _, c in cloud.fields)
    types = " ".join(PCD_TYPE[c][0] for _, c in cloud.fields)
    head = (f"# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {names}\nSIZE {sizes}\nTYPE {types}\n"
            f"COUNT {' '.join('1' for _ in cloud.fields)}\nWIDTH {count if width is None else width}\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count if points is None else points}\nDATA {data}\n")
    if data == "ascii":
        body = "".join(" ".join(format(v, ".9g") if isinstance(v, float) else str(v) for v in row) + "\n"
                       for row in cloud.rows).encode()
    else:
        body = pack(cloud)
    return head.encode() + body


def ply_bytes(cloud, count=None):
    """Binary little-endian; rgb as red, green, blue."""
    fields, rows = cloud.fields, cloud.rows
    lines = []
    for name, code in fields:
        lines += [f"property uchar {c}" for c in ("red", "green", "blue")] if name == "rgb" else [f"property {PLY_TYPE[code]} {name}"]
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows) if count is None else count}\n"
            + "\n".join(lines) + "\nend_header\n")
    code = "<" + "".join("BBB" if n == "rgb" else c for n, c in fields)
    at = [n for n, _ in fields].index("rgb") if "rgb" in dict(fields) else None
    split = lambda row: row if at is None else row[:at] + (row[at] >> 16 & 255, row[at] >> 8 & 255, row[at] & 255) + row[at + 1:]
    return head.encode() + b"".join(struct.pack(code, *split(row)) for row in rows)


def pack(cloud):
    packer = struct.Struct("<" + "".join(c for _, c in cloud.fields))
    return b"".join(packer.pack(*row) for row in cloud.rows)


def write(path, data):
    path.write_bytes(data)
    return path


def read_pcd(path):
    """An uncompressed PCD."""
    data = path.read_bytes()
    end = data.index(b"\nDATA ") + 1
    stop = data.index(b"\n", end)
    head = {k[0]: k[1:] for k in (line.split() for line in data[:stop].decode().splitlines()) if k and k[0] != "#"}
    code = {("F", 4): "f", ("F", 8): "d", ("U", 1): "B", ("U", 2): "H", ("U", 4): "I", ("U", 8): "Q",
            ("I", 1): "b", ("I", 2): "h", ("I", 4): "i", ("I", 8): "q"}
    fields = []
    for name, size, kind, n in zip(head["FIELDS"], head["SIZE"], head["TYPE"], head.get("COUNT", ["1"] * 99)):
        fields += [(name, code[kind, int(size)])] * int(n)
    names = {n: k for k, (n, _) in enumerate(fields)}
    body = data[stop + 1:]
    if head["DATA"] == ["ascii"]:
        rows = [tuple(float(v) if c in "fd" else int(v) for v, (_, c) in zip(line.split(), fields))
                for line in body.decode().splitlines()]
    else:
        packer = struct.Struct("<" + "".join(c for _, c in fields))
        rows = list(packer.iter_unpack(body[: packer.size * int(head["POINTS"][0])]))
    fields = [(n, "I") if n == "rgb" else (n, c) for n, c in fields]
    if "rgb" in names:  # PCL writes the packed colour as a float
        k = names["rgb"]
        as_int = lambda v: struct.unpack("<I", struct.pack("<f", v))[0] if isinstance(v, float) else v
        rows = [row[:k] + (as_int(row[k]) & 0xFFFFFF,) + row[k + 1:] for row in rows]
    assert len(rows) == int(head["POINTS"][0]), "the file holds fewer points than it says"
    return Cloud(tuple(fields), rows)


def columns(cloud, names):
    at = [[n for n, _ in cloud.fields].index(name) for name in names]
    return [tuple(row[k] for k in at) for row in cloud.rows]


def positions(cloud):
    return columns(cloud, "xyz")


class Nearest:
    """Nearest neighbours by a hash grid; Chebyshev and Euclidean."""

    def __init__(self, points, cell):
        self.cell, self.grid = cell, {}
        for p in points:
            self.grid.setdefault(self.key(p), []).append(p)

    def key(self, p):
        return tuple(int(v // self.cell) for v in p)

    def candidates(self, p):
        kx, ky, kz = self.key(p)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                for dz in (-1, 0, 1):
                    yield from self.grid.get((kx + dx, ky + dy, kz + dz), ())

    def axis_error(self, p):
        return min((max(abs(a - b) for a, b in zip(p, q)) for q in self.candidates(p)), default=float("inf"))

    def squared(self, p):
        return min((sum((a - b) ** 2 for a, b in zip(p, q)) for q in self.candidates(p)), default=float("inf"))


def symmetric_rms(a, b, cell):
    def one_way(p, q):
        index = Nearest(q, cell)
        return (sum(index.squared(v) for v in p) / len(p)) ** 0.5
    return max(one_way(a, b), one_way(b, a))
