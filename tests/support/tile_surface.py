# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, section 10: geometry of `surface` tiles. Slow and plain; see read_tile.py."""
import pathlib
import re
import struct

from read_archive import Damaged, Reader
from tile_entropy import BitModel, Models, RangeDecoder, clamp

HEIGHT = 256       # 10.2: heights per unit
PLANE_STEP = 4096  # heights
MOST_HEIGHT = 1 << 30
HALF = 32768       # 10.5: vertex coordinates of a face
NONE = -1


def div(a, b):
    """Integer division that rounds towards zero."""
    q = abs(a) // abs(b)
    return q if (a < 0) == (b < 0) else -q


def height(v):
    return clamp(v, -MOST_HEIGHT, MOST_HEIGHT)


def half_side(log2_side):
    return HEIGHT << log2_side >> 1


# --- 10.2 Planes --------------------------------------------------------------------------------------------------

class Plane:
    def __init__(self, h=0, a=0, b=0, axis=2):
        self.h, self.a, self.b, self.axis = h, a, b, axis


def in_child(p, split, upper, log2_side):
    c = Plane(p.h, p.a, p.b, p.axis)
    if split == p.axis:
        shift = half_side(log2_side) // 2
        c.h = height(p.h + (-shift if upper else shift))
        return c
    if split == (p.axis + 1) % 3:
        c.a >>= 1
        rise = c.a
    else:
        c.b >>= 1
        rise = c.b
    c.h = height(p.h + (rise if upper else -rise))
    return c


def seen_from(p, at, shape, to, to_shape):
    u, v, k = (p.axis + 1) % 3, (p.axis + 2) % 3, p.axis

    def between(d):
        return 2 * (to[d] - at[d]) + (1 << to_shape[d]) - (1 << shape[d])

    h = height(p.h + (p.a * between(u) >> shape[u]) + (p.b * between(v) >> shape[v]) - between(k) * 128)
    return Plane(h, p.a >> shape[u] - to_shape[u], p.b >> shape[v] - to_shape[v], k)


def turned(p, axis, shape):
    """The plane with its height along `axis`; None if it is too steep."""
    if p.axis == axis:
        return p
    first = (p.axis + 1) % 3 == axis
    slope, other = (p.a, p.b) if first else (p.b, p.a)
    own, target = half_side(shape[p.axis]), half_side(shape[axis])
    if slope == 0 or 4 * abs(slope) < own:
        return None
    across, along = height(div(-target * other, slope)), height(div(target * own, slope))
    h = height(div(-target * p.h, slope))
    return Plane(h, across, along, axis) if first else Plane(h, along, across, axis)


# --- 10.4 Models --------------------------------------------------------------------------------------------------

LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz+-"
EXPERIENCE = 16
TABLES = [("own", 48 * 2 * 7), ("divided", 48 * 3 * 7 * 4), ("wedge", 48 * 7), ("block", 48 * 3), ("noise", 16 * 2 * 5),
          ("angle", 16), ("offset", 32), ("both", 8 * 16 * 8 * 3), ("side", 8 * 16 * 3 * 3), ("few", 6 * 8 * 8),
          ("many", 14 * 3 * 8), ("many_sign", 14 * 3), ("same_axis", 2), ("axis", 8), ("plane", 16 * 2 * 2 * 8),
          ("plane_sign", 1)]


def prior_text():
    """The table of 10.4, as the library's source has it."""
    source = pathlib.Path(__file__).resolve().parents[2] / "mapcodec/codec/surface_prior.hpp"
    return "".join(re.findall(r'"([0-9A-Za-z+.-]*)"', source.read_text().split("kPrior", 1)[1]))


class SurfaceModels(Models):
    """Bit models by (table, index), those in the prior with what it says."""

    text = None

    def __init__(self):
        super().__init__()
        if SurfaceModels.text is None:
            SurfaceModels.text = prior_text()
        self.first, at = {}, 0
        for name, size in TABLES:
            self.first[name] = at
            at += size

    def __missing__(self, key):
        model = BitModel()
        name, index = key[0], key[1]
        at = self.first[name] + index if name in self.first else len(self.text)
        letter = self.text[at] if at < len(self.text) else "."
        if letter != ".":
            p = int(65536 / (1 + 2 ** ((31.5 - LETTERS.index(letter)) / 4)) + 0.5)
            model.fast = model.slow = p
            model.n = EXPERIENCE
        self[key] = model
        return model


def crowd_of(n):
    return sum(n >= t for t in (2, 3, 6, 12, 32, 128))


def share_class(share):
    if share < 0:
        return 0
    if share in (0, 256):
        return 1 if share == 0 else 7
    return 2 + sum(share >= t for t in (32, 96, 161, 225))


class Symbols:
    def __init__(self, data, count_shift):
        self.d, self.m, self.count_shift = RangeDecoder(data), SurfaceModels(), count_shift

    def bit(self, table, index):
        return self.d.bit(self.m[(table, index)])

    def tree(self, table, first, bits):
        node = 1
        for _ in range(bits):
            node = 2 * node + self.bit(table, first + node)
        return node - (1 << bits)

    def magnitude(self, table, number):
        """Model `number` of a table of magnitude models."""
        length = 0
        while length < 24:
            # Only the first eight bits of the unary code are in the prior.
            key = (table, 8 * number + length) if length < 8 else (table + ".unary", (number, length))
            if not self.d.bit(self.m[key]):
                break
            length += 1
        if length < 2:
            return length
        v = 2 | self.d.bit(self.m[(table + ".below", (number, length))])
        return v << length - 2 | self.d.raw(length - 2)

    def signed(self, table, number, sign_table, sign):
        size = self.magnitude(table, number)
        return -size if size and self.bit(sign_table, sign) else size

    def plane(self, expected, shape, size):
        if expected is not None and self.bit("same_axis", 0):
            axis = expected.axis
        elif expected is not None:
            axis = (expected.axis + 1 + self.bit("same_axis", 1)) % 3
        else:
            axis = min(2, self.tree("axis", 0, 2))
        base = turned(expected, axis, shape) if expected is not None else None
        number = size // 3 * 2 + (base is not None)
        base = base or Plane(axis=axis)

        def field(guess, which):
            steps = guess + PLANE_STEP // 2 >> 12
            return height((steps + self.signed("plane", 2 * number + which, "plane_sign", 0)) * PLANE_STEP)

        h = field(base.h, 0)
        a = field(base.a, 1)
        return Plane(h, a, field(base.b, 1), axis)

    def noise(self, size, voxels):
        at = ((size // 3) * 2 + voxels) * 5
        return 1 + self.tree("noise", at, 2) if self.bit("noise", at) else 0

    def halves(self, n, crowd, size, below, above, share):
        at = (share_class(share) * 4 + below) * 4 + above
        fine = 0 if size < 9 else 1 if size < 18 else 2
        if n > 1 and self.bit("both", (at * 8 + crowd) * 3 + fine):
            return 0
        kind = 2 if crowd == 7 else int(n > 1)
        return 2 if self.bit("side", (at * 3 + kind) * 3 + fine) else 1

    def lower_count(self, n, share):
        if n == 2:
            return 1
        if n <= 8:
            return min(n - 1, 1 + self.tree("few", ((n - 3) * 8 + share_class(share)) * 8, 3))
        expected = clamp(n * (128 if share < 0 else share) + 128 >> 8, 1, n - 1)
        step = max(1, n >> self.count_shift)
        width = min(17, n.bit_length()) - 4
        sure = 0 if share < 0 else 1 if share < 96 or share > 160 else 2
        return clamp(expected + self.signed("many", width * 3 + sure, "many_sign", width * 3 + sure) * step, 1, n - 1)


# --- 10.3 The tree ------------------------------------------------------------------------------------------------

class Cell:
    def __init__(self, at, count, plane, block):
        self.at, self.count, self.plane, self.block = at, count, plane, block
        self.link, self.child, self.leaf, self.state = [NONE] * 6, [NONE, NONE], NONE, "unknown"


class Leaf:
    def __init__(self, cell, shape):
        self.at, self.shape, self.count, self.plane, self.block = cell.at, tuple(shape), cell.count, cell.plane, cell.block
        self.wedge, self.noise, self.seam = None, 0, None


class Tree:
    def __init__(self, symbols, block_bits, outline):
        self.s, self.v, self.outline = symbols, block_bits, outline
        self.leaves, self.blocks, self.joints = [], [], []

    def read(self, count, depth):
        self.shape = [depth] * 3
        self.cells = [Cell([0, 0, 0], count, None, NONE)]
        level = 0
        while self.cells:
            self.next = []
            for i, cell in enumerate(self.cells):
                if level >= 3 * depth:
                    self.add_leaf(cell, None, False)
                else:
                    self.read_cell(i, cell, level % 3)
            if len(self.next) > count:
                raise Damaged("more cells than points")
            self.note_joints()
            self.link_children(level % 3)
            self.shape[level % 3] -= 1
            self.cells, level = self.next, level + 1

    def context(self, i, cell, axis):
        leaves = divided = below = above = 0
        for face, l in enumerate(cell.link):
            if l == NONE:
                continue
            n = self.cells[l] if 0 <= l < i else None
            is_divided = n is not None and n.state == "divided"
            leaves += (l < 0 or l < i) and not is_divided
            divided += is_divided
            if face // 2 == axis:
                below, above = below + (face % 2 == 0), above + (face % 2 == 1)
            elif is_divided:
                below, above = below + (n.child[0] != NONE), above + (n.child[1] != NONE)
        size = min(47, sum(self.shape))
        crowd = 7 if cell.block >= 0 else crowd_of(cell.count)
        neighbors = (1 if leaves else 0) if divided == 0 else (2 if leaves else 3)
        return size, crowd, neighbors, min(3, below), min(3, above)

    def read_cell(self, i, cell, axis):
        c = size, crowd, neighbors, _, _ = self.context(i, cell, axis)
        if cell.block >= 0:
            if sum(self.shape) == 3 * self.v:
                self.add_leaf(cell, None, False)
            else:
                self.divide(cell, c, axis)
            return
        own = False
        if cell.count >= 3:
            own = bool(self.s.bit("own", (size * 2 + (cell.plane is not None)) * 7 + crowd))
            if own:
                cell.plane = self.s.plane(self.expected(i, cell), self.shape, size)
        plane = 2 if own else int(cell.plane is not None)
        if self.s.bit("divided", ((size * 3 + plane) * 7 + crowd) * 4 + neighbors):
            self.divide(cell, c, axis)
        elif self.can_be_block(cell) and self.s.bit("block", size * 3 + plane):
            cell.block = len(self.blocks)
            self.blocks.append((cell.count, self.s.noise(size, 1)))
            self.divide(cell, c, axis)
        else:
            self.add_leaf(cell, c, True)

    def can_be_block(self, cell):
        levels = sum(self.shape) - 3 * self.v
        return self.v > 0 and cell.count >= 4 and min(self.shape) >= self.v and 0 < levels <= 9

    def expected(self, i, cell):
        if cell.plane is not None:
            return cell.plane
        nearest, found = 1 << 40, None
        for l in cell.link:
            if l == NONE or l >= i:
                continue
            n, shape = (self.cells[l], self.shape) if l >= 0 else (self.leaves[-2 - l], self.leaves[-2 - l].shape)
            if n.plane is None:
                continue
            here = seen_from(n.plane, n.at, shape, cell.at, self.shape)
            if abs(here.h) <= half_side(self.shape[here.axis]) and abs(here.h) < nearest:
                nearest, found = abs(here.h), here
        return found

    def divide(self, cell, c, axis):
        size, crowd, _, below, above = c
        cell.state = "divided"
        in_block = cell.block >= 0
        room = self.outline.room(cell.at, self.shape)
        share = lower_share(cell.plane, self.shape, room, axis) if cell.plane is not None else -1
        halves = self.s.halves(2 if in_block else cell.count, crowd, size, below, above, share)
        lower = 0
        if not in_block:
            lower = cell.count if halves == 1 else 0 if halves == 2 else self.s.lower_count(cell.count, share)
        for h in (0, 1):
            if halves == 2 - h:
                continue
            at = list(cell.at)
            at[axis] += h << self.shape[axis] >> 1
            plane = None if cell.plane is None else in_child(cell.plane, axis, h == 1, self.shape[axis])
            cell.child[h] = len(self.next)
            self.next.append(Cell(at, 0 if in_block else (cell.count - lower if h else lower), plane, cell.block))

    def add_leaf(self, cell, c, coded):
        leaf = Leaf(cell, self.shape)
        cell.state = "leaf"
        if coded and cell.plane is not None and cell.count >= 6:
            size, crowd = c[0], c[1]
            wedged = self.s.bit("wedge", size * 7 + crowd)
            leaf.noise = self.s.noise(size, 0)
            if wedged:
                leaf.wedge = (self.s.tree("angle", 0, 4), self.s.tree("offset", 0, 5))
        cell.leaf = len(self.leaves)
        self.leaves.append(leaf)

    def note_joints(self):
        """Pairs of touching leaves: (from, to beyond a face of it, that face)."""
        for i, cell in enumerate(self.cells):
            for face, l in enumerate(cell.link):
                if cell.state != "leaf" or l == NONE or l > i or (l >= 0 and self.cells[l].state != "leaf"):
                    continue
                a, b = self.leaves[cell.leaf], self.leaves[-2 - l if l < 0 else self.cells[l].leaf]
                if all(x.plane is not None and x.block < 0 and x.count >= 6 for x in (a, b)):
                    self.joints.append((a, b, face))

    def link_children(self, axis):
        for cell in self.cells:
            for h in (0, 1):
                if cell.child[h] == NONE:
                    continue
                link = self.next[cell.child[h]].link
                for face in range(6):
                    if face // 2 != axis:
                        link[face] = self.follow(cell.link[face], h)
                    elif face % 2 == h:
                        link[face] = self.follow(cell.link[face], 1 - h)
                    else:
                        link[face] = cell.child[1 - h]

    def follow(self, l, half):
        if l < 0:
            return l
        n = self.cells[l]
        return -2 - n.leaf if n.state == "leaf" else n.child[half]


# --- 10.5 Polygons and points -------------------------------------------------------------------------------------

COS = [4096, 3784, 2896, 1567, 0, -1567, -2896, -3784, -4096, -3784, -2896, -1567, 0, 1567, 2896, 3784]


def between(p, q, fp, fq):
    return tuple(a + div((b - a) * fp, fp - fq) for a, b in zip(p, q))


def edges(polygon):
    return zip(polygon, polygon[1:] + polygon[:1])


def clipped(polygon, c, gu, gv):
    r = []
    for p, q in edges(polygon):
        fp, fq = (c + (gu * x[0] + gv * x[1] >> 15) for x in (p, q))
        if fp <= 0:
            r.append(p)
        if fp < 0 < fq or fq < 0 < fp:
            r.append(between(p, q, fp, fq))
    return r[:12]


OVERLAP = 12  # units


class Outline:
    """10.1: how far a tile's points reach, and the borders at which its surface goes on."""

    def __init__(self, fitted=False, end=None, borders=0):
        self.fitted, self.end, self.borders = fitted, end, borders

    def goes_on(self, axis, upper):
        return self.borders >> 2 * axis + upper & 1

    def room(self, at, shape, wide=None):
        """(begin, end) per axis in units from a cell's corner; with the overlap across axis `wide`."""
        begin, end = [0] * 3, [1 << s for s in shape]
        if self.fitted:
            end = [min(e, max(1, self.end[d] - at[d])) for d, e in enumerate(end)]
        if wide is not None:
            end[wide] += OVERLAP * (at[wide] + end[wide] == self.end[wide] and self.goes_on(wide, 1))
            begin[wide] -= OVERLAP * (at[wide] == 0 and self.goes_on(wide, 0))
        return begin, end


def whole_room(shape):
    return [0] * 3, [1 << s for s in shape]


def rectangle_of(room, shape, axis):
    (u0, v0), (u1, v1) = ([(x[d] << 16 >> shape[d]) - HALF for d in ((axis + 1) % 3, (axis + 2) % 3)] for x in room)
    return [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]


def limits(plane, shape, room):
    half, k = half_side(shape[plane.axis]), plane.axis
    return half - room[0][k] * HEIGHT, room[1][k] * HEIGHT - half


def polygon_of(plane, shape, room):
    half, reach = half_side(shape[plane.axis]), abs(plane.a) + abs(plane.b)
    if abs(plane.h) > half + reach:
        return []
    bottom, top = limits(plane, shape, room)
    p = rectangle_of(room, shape, plane.axis)
    if plane.h + reach > top:
        p = clipped(p, plane.h - top, plane.a, plane.b)
    if -plane.h + reach > bottom:
        p = clipped(p, -plane.h - bottom, -plane.a, -plane.b)
    return p


def is_whole(plane, shape, room):
    """Whether nothing along its axis cuts the plane: its polygon is treated as a rectangle."""
    bottom, top = limits(plane, shape, room)
    reach = abs(plane.a) + abs(plane.b)
    return plane.h + reach <= top and -plane.h + reach <= bottom


def cut(polygon, wedge):
    c, s = COS[wedge[0]], COS[(wedge[0] + 12) % 16]
    most = (abs(c) + abs(s)) * HALF
    return clipped(polygon, -div(most * (wedge[1] - 15), 16), c << 15, s << 15)


def twice_area(polygon):
    return sum(p[0] * q[1] - p[1] * q[0] for p, q in edges(polygon))


def lower_share(plane, shape, room, split):
    p = polygon_of(plane, shape, room)
    area = twice_area(p)
    if len(p) < 3 or area < 256:
        return -1
    if split == plane.axis:
        p = clipped(p, plane.h, plane.a, plane.b)
    elif is_whole(plane, shape, room) and room[1][split] == 1 << shape[split]:
        return 128
    else:
        first = split == (plane.axis + 1) % 3
        p = clipped(p, 0, HALF if first else 0, 0 if first else HALF)
    return clamp(div(twice_area(p), area >> 8), 0, 256)


def density(tilt, d, x, y):
    """At x along axis d of (u, v), y along the other."""
    return max((256 << 15) + tilt[d] * x + tilt[1 - d] * y, 32 << 15)


def tilted_share(lower, count, r0, r1):
    even = (lower << 16) // count
    return even + div((even * (65536 - even) >> 16) * (r1 - r0), r1 + r0)


def spread_rectangle(low, high, w, tilt, count, out):
    if count == 1:
        out.append((low[0] + high[0] >> 1, low[1] + high[1] >> 1))
        return
    lower = count // 2
    d = 0 if w[0] * (high[0] - low[0]) >= w[1] * (high[1] - low[1]) else 1
    length, y = high[d] - low[d], low[1 - d] + high[1 - d] >> 1
    if tilt == (0, 0):
        middle = low[d] + div(length * lower, count)
    else:
        share = tilted_share(lower, count, density(tilt, d, low[d], y), density(tilt, d, high[d], y))
        middle = low[d] + (length * share >> 16)
    spread_rectangle(low, (middle, high[1]) if d == 0 else (high[0], middle), w, tilt, lower, out)
    spread_rectangle((middle, low[1]) if d == 0 else (low[0], middle), high, w, tilt, count - lower, out)


def centroid(p):
    o, area, su, sv = p[0], 0, 0, 0
    for x, y in zip(p[1:], p[2:]):
        a, b = (x[0] - o[0], x[1] - o[1]), (y[0] - o[0], y[1] - o[1])
        twice = a[0] * b[1] - a[1] * b[0]
        area += twice
        su += (twice >> 4) * (a[0] + b[0])
        sv += (twice >> 4) * (a[1] + b[1])
    area = (area >> 4) * 3
    if area <= 0:
        return tuple(div(sum(x[d] for x in p), len(p)) for d in (0, 1))
    return o[0] + div(su, area), o[1] + div(sv, area)


def width_at(p, d, x):
    ys = []
    for a, b in edges(p):
        if x == a[d]:
            ys.append(a[1 - d])
        elif a[d] < x < b[d] or b[d] < x < a[d]:
            ys.append(a[1 - d] + div((b[1 - d] - a[1 - d]) * (x - a[d]), b[d] - a[d]))
    return max(0, max(ys) - min(ys)) if ys else 0


def cut_position(p, d, tilt, lower, count):
    stops = sorted(x[d] for x in p)
    total = twice_area(p)
    if tilt == (0, 0):
        goal = div(total, count) * lower + div((total - div(total, count) * count) * lower, count)
    else:
        y = div(sum(x[1 - d] for x in p), len(p))
        goal = total * tilted_share(lower, count, density(tilt, d, stops[0], y), density(tilt, d, stops[-1], y)) >> 16
    w0 = width_at(p, d, stops[0])
    for x0, x1 in zip(stops, stops[1:]):
        length = x1 - x0
        if length == 0:
            continue
        w1 = width_at(p, d, x1)
        slab = length * (w0 + w1)
        if slab < goal:
            goal -= slab
            w0 = w1
            continue
        low, high = 0, length
        while low < high:
            m = (low + high) // 2
            if m * (2 * w0 * length + (w1 - w0) * m) < goal * length:
                low = m + 1
            else:
                high = m
        return x0 + low
    return stops[-1]


def part(p, d, at, sign):
    r = []
    for a, b in edges(p):
        fa, fb = sign * (a[d] - at), sign * (b[d] - at)
        if fa <= 0:
            r.append(a)
        if fa < 0 < fb or fb < 0 < fa:
            x = list(between(a, b, fa, fb))
            x[d] = at
            r.append(tuple(x))
    return r[:12]


def spread_polygon(p, w, tilt, count, out):
    if count == 1:
        out.append(centroid(p))
        return
    sides = [max(x[d] for x in p) - min(x[d] for x in p) for d in (0, 1)]
    d = 0 if w[0] * sides[0] >= w[1] * sides[1] else 1
    lower = count // 2
    at = cut_position(p, d, tilt, lower, count)
    for sign, n in ((1, lower), (-1, count - lower)):
        piece = part(p, d, at, sign)
        spread_polygon(piece if len(piece) >= 3 else p, w, tilt, n, out)


def spread(p, whole, plane, shape, tilt, count):
    def stretch(flat, rise):
        return max(flat, abs(rise)) + min(flat, abs(rise)) * 3 // 8

    u, v, out = (plane.axis + 1) % 3, (plane.axis + 2) % 3, []
    w = stretch(half_side(shape[u]), plane.a), stretch(half_side(shape[v]), plane.b)
    if count > 0 and whole:
        spread_rectangle(p[0], p[2], w, tilt, count, out)
    elif count > 0:
        spread_polygon(p, w, tilt, count, out)
    return out


# --- 10.5 Leaves beside each other --------------------------------------------------------------------------------

STEP = 32 * HEIGHT


class Seam:
    def __init__(self):
        self.bridges, self.beyond, self.tilt = {}, {}, (0, 0)


def seam_of(leaf):
    leaf.seam = leaf.seam or Seam()
    return leaf.seam


def rise(plane, x):
    return plane[0] + (plane[1] * x[0] + plane[2] * x[1] >> 15)


def on_face(axis, face, x):
    at = HALF if face % 2 else -HALF
    return (at, x[1]) if face // 2 == (axis + 1) % 3 else (x[0], at)


def bridge(leaf, other, face, alone, outline):
    p, k = leaf.plane, leaf.plane.axis
    there = turned(seen_from(other.plane, other.at, other.shape, leaf.at, leaf.shape), k, leaf.shape)
    if there is None:
        return
    d = there.h - p.h, there.a - p.a, there.b - p.b
    if face // 2 == k:
        half, edge = half_side(leaf.shape[k]), []
        for x in polygon_of(p, leaf.shape, outline.room(leaf.at, leaf.shape)):
            z = rise((p.h, p.a, p.b), x)
            if (half - z if face % 2 else half + z) <= (abs(p.a) + abs(p.b) >> 14) + 2:
                edge.append(abs(rise(d, x)))
        meets = len(edge) >= 2 and max(edge) <= min(STEP // 2, max(abs(p.a), abs(p.b)) // 2)
    else:
        meets = all(abs(rise(d, on_face(k, face, (e, e)))) <= STEP for e in (-HALF, HALF))
    if meets:
        seam_of(leaf).bridges[face] = d if alone else tuple(x >> 1 for x in d)


def area_of(leaf, outline):
    p = polygon_of(leaf.plane, leaf.shape, outline.room(leaf.at, leaf.shape))
    if len(p) >= 3 and leaf.wedge is not None:
        p = cut(p, leaf.wedge)
    u, v = (leaf.plane.axis + 1) % 3, (leaf.plane.axis + 2) % 3
    if len(p) < 3 or twice_area(p) <= 0:
        return 0
    a, b = (min(65535, abs(div(x * 256, half_side(leaf.shape[d])))) for x, d in ((leaf.plane.a, u), (leaf.plane.b, v)))
    steep = max(a, b) + min(a, b) * 3 // 8
    stretch = max(steep, 256) + min(steep, 256) * 3 // 8
    return max(1, (twice_area(p) << leaf.shape[u] + leaf.shape[v] >> 33) * stretch >> 8)


def rise_to(leaf, beyond, axis, outline):
    area, there_area = area_of(leaf, outline), min(1 << 60, sum(area_of(x, outline) for x in beyond))
    if area == 0 or there_area == 0:
        return None
    points = sum(x.count for x in beyond)
    count_bits = max(0, max(points, leaf.count).bit_length() - 24)
    area_bits = max(0, max(area, there_area).bit_length() - 28)
    there = (points >> count_bits) * (area >> area_bits)
    here = (leaf.count >> count_bits) * (there_area >> area_bits)
    if there + here <= 0:
        return None
    distance = 16 + ((sum(1 << x.shape[axis] for x in beyond) // len(beyond)) << 4 >> leaf.shape[axis])
    return div(div(there - here, max(1, there + here >> 9)) * 16, distance)


def tilt_along(leaf, axis, outline):
    low, high = (rise_to(leaf, leaf.seam.beyond[2 * axis + f], axis, outline) if 2 * axis + f in leaf.seam.beyond else None
                 for f in (0, 1))
    low = None if low is None else -low
    if low is None or high is None:
        tilt = (low or 0) + (high or 0)
    elif (low < 0) != (high < 0):
        tilt = 0
    else:
        tilt = min(abs(low + high) // 2, 2 * min(abs(low), abs(high))) * (-1 if low < 0 else 1)
    return clamp(tilt, -192, 192)


def join(tree):
    for a, b, face in tree.joints:
        alike = a.shape == b.shape
        for leaf, other, f, bends in ((a, b, face, True), (b, a, face ^ 1, alike)):
            if bends:
                bridge(leaf, other, f, not alike, tree.outline)
            if f // 2 != leaf.plane.axis and other.plane.axis == leaf.plane.axis and leaf.count >= 16:
                seam_of(leaf).beyond.setdefault(f, []).append(other)
    for leaf in tree.leaves:
        if leaf.seam is not None:
            k = leaf.plane.axis
            leaf.seam.tilt = tuple(tilt_along(leaf, (k + 1 + i) % 3, tree.outline) for i in (0, 1))


def bridged(leaf, room, bare):
    """The polygon with its edges at the faces along the plane's axis where the surfaces meet."""
    p, k = leaf.plane, leaf.plane.axis
    low, high = (leaf.seam.bridges.get(2 * k + f) for f in (0, 1))
    if low is None and high is None:
        return bare
    half = half_side(leaf.shape[k])
    bottom, top = limits(p, leaf.shape, room)
    r = clipped(rectangle_of(room, leaf.shape, k), p.h - top - (STEP // 2 if high else 0), p.a, p.b)
    r = clipped(r, -p.h - bottom - (STEP // 2 if low else 0), -p.a, -p.b)
    if high:
        r = clipped(r, p.h + high[0] - half, p.a + high[1], p.b + high[2])
    if low:
        r = clipped(r, -(p.h + low[0]) - half, -(p.a + low[1]), -(p.b + low[2]))
    return r if len(r) >= 3 and 2 * twice_area(r) >= twice_area(bare) else bare


def height_of(leaf, outline, x):
    p, k = leaf.plane, leaf.plane.axis
    half, z = half_side(leaf.shape[k]), rise((p.h, p.a, p.b), x)
    if not outline.fitted:
        return clamp(z, -half, half)
    bent = z
    for face, b in (leaf.seam.bridges if leaf.seam else {}).items():
        if face // 2 == k:
            edge, away, ramp = x, (half - z if face % 2 else half + z), max(abs(p.a), abs(p.b)) // 4
        else:
            edge = on_face(k, face, x)
            away, ramp = abs(edge[0] - x[0]) + abs(edge[1] - x[1]), HALF // 2
        if away < ramp:
            bent += div(rise(b, edge) * min(ramp - away, ramp), ramp)
    return bent


def overlapped(leaf, outline, x):
    x = list(x)
    for i in (0, 1):
        d = (leaf.plane.axis + 1 + i) % 3
        most = OVERLAP << 16 >> leaf.shape[d]
        low = (leaf.at[d] << 16 >> leaf.shape[d]) + HALF + x[i]
        high = (outline.end[d] - leaf.at[d] << 16 >> leaf.shape[d]) - HALF - x[i]
        if outline.goes_on(d, 0) and low < most:
            x[i] -= most - low
        if outline.goes_on(d, 1) and high < most:
            x[i] += most - high
    return x


def noise_offset(noise, i):
    if noise == 0:
        return 0
    reverse = int(f"{i & 255:08b}"[::-1], 2)
    return (2 * reverse - 255) << noise + 2


def leaf_points(leaf, outline, out):
    center = [(leaf.at[d] << 4) + (1 << leaf.shape[d] + 3) for d in range(3)]
    polygon, whole, over = [], False, False
    if leaf.plane is not None:
        over = outline.borders != 0 and leaf.count >= 6 and leaf.block < 0
        room = whole_room(leaf.shape)
        if leaf.block < 0:
            room = outline.room(leaf.at, leaf.shape, leaf.plane.axis if over else None)
        bare, whole = polygon_of(leaf.plane, leaf.shape, room), is_whole(leaf.plane, leaf.shape, room)
        polygon = bridged(leaf, room, bare) if leaf.seam else bare
        whole = whole and polygon is bare
    if len(polygon) >= 3 and leaf.wedge is not None:
        polygon, whole = cut(polygon, leaf.wedge), False
    if len(polygon) < 3:
        out.extend([center] * leaf.count)
        return
    k = leaf.plane.axis
    u, v = (k + 1) % 3, (k + 2) % 3
    tilt = leaf.seam.tilt if leaf.seam else (0, 0)
    for i, x in enumerate(spread(polygon, whole, leaf.plane, leaf.shape, tilt, leaf.count)):
        if over:
            x = overlapped(leaf, outline, x)
        z = height_of(leaf, outline, x) + noise_offset(leaf.noise, i)
        p = list(center)
        p[u] += (x[0] << leaf.shape[u]) + 2048 >> 12
        p[v] += (x[1] << leaf.shape[v]) + 2048 >> 12
        p[k] += z + 8 >> 4
        out.append(p)


# --- 10.6 Blocks of voxels ----------------------------------------------------------------------------------------

def fit(occupied, at, v):
    here = [x >> v for x in at]
    n, first, second = 0, [0] * 3, [[0] * 3 for _ in range(3)]
    for dz in range(-2, 3):
        for dy in range(-2, 3):
            for dx in range(-2, 3):
                o = (dx, dy, dz)
                if dx * dx + dy * dy + dz * dz > 4 or tuple(a + b for a, b in zip(here, o)) not in occupied:
                    continue
                n += 1
                for d in range(3):
                    first[d] += o[d]
                    for e in range(3):
                        second[d][e] += o[d] * o[e]

    def covariance(d, e):
        return n * second[d][e] - first[d] * first[e]

    best = None
    for k in range(3):
        u, w = (k + 1) % 3, (k + 2) % 3
        ridge = n * n // 6 + 1
        uu, ww, uw = covariance(u, u) + ridge, covariance(w, w) + ridge, covariance(u, w)
        uz, wz, zz = covariance(u, k), covariance(w, k), covariance(k, k)
        det = uu * ww - uw * uw
        a = div((uz * ww - wz * uw) << 12, det)
        b = div((wz * uu - uz * uw) << 12, det)
        h = div((first[k] << 12) - a * first[u] - b * first[w], n)
        residual = div(((zz << 12) - a * uz - b * wz) << 12, 4096 + (a * a + b * b >> 12))
        if best is None or residual < best[0]:
            best = residual, h, a, b, k
    _, h, a, b, k = best
    side = 2 * half_side(v)
    return Plane(height(h * side >> 12), height(a * (side // 2) >> 12), height(b * (side // 2) >> 12), k)


def weight_of(leaf):
    polygon = polygon_of(leaf.plane, leaf.shape, whole_room(leaf.shape))
    if len(polygon) < 3:
        return 1
    half = half_side(leaf.shape[0])
    a, b = div(leaf.plane.a << 8, half), div(leaf.plane.b << 8, half)
    return max(1, (twice_area(polygon) >> 16) * (256 + (a * a + b * b >> 10)))


def settle_blocks(leaves, blocks, v, others):
    voxels = [l for l in leaves if l.block >= 0]
    occupied = {tuple(x >> v for x in l.at) for l in voxels} | {tuple(max(0, x) >> v + 4 for x in p) for p in others}
    weight, number = [0] * len(blocks), [0] * len(blocks)
    for l in voxels:
        l.plane = fit(occupied, l.at, v)
        weight[l.block] += weight_of(l)
        number[l.block] += 1
    before, given = [0] * len(blocks), [0] * len(blocks)
    for l in voxels:
        b = l.block
        count, l.noise = blocks[b]
        base = int(count >= number[b])
        before[b] += weight_of(l)
        upto = before[b] * (count - base * number[b]) // weight[b]
        l.count = base + upto - given[b]
        given[b] = upto


# --- 10.1 The section, 10.7 the order of the points ---------------------------------------------------------------

def read_surface(section, count, schema, step):
    r = Reader(section)
    voxel_shift, base = r.uint(1), [r.signed() for _ in range(3)]
    depth, outline = r.uint(1), Outline()
    if depth & 128:
        depth, borders = depth & 127, r.uint(1)
        outline = Outline(True, [32 * r.varint() for _ in range(3)], borders)
    count_shift, block_bits = r.uint(1), r.uint(1)
    tree = Tree(Symbols(r.raw(r.left()), count_shift), block_bits, outline)
    tree.read(count, depth)
    if outline.fitted:
        join(tree)
    points = []
    for leaf in tree.leaves:
        if leaf.block < 0:
            leaf_points(leaf, outline, points)
    if tree.blocks:
        settle_blocks(tree.leaves, tree.blocks, block_bits, points)
    for leaf in tree.leaves:
        if leaf.block >= 0:
            leaf_points(leaf, outline, points)
    if len(points) != count:
        raise Damaged("other than the announced number of points")
    most, beside = 16 << depth, 16 * OVERLAP if outline.fitted else 0
    points = [[clamp(v, -beside, most + beside) for v in p] for p in points]
    voxels = None
    if voxel_shift != 255:
        def key(p):
            return sum((clamp(p[a], 0, most) >> voxel_shift >> i & 1) << 3 * i + a for i in range(21) for a in range(3))

        points.sort(key=key)
        voxels = [tuple(clamp(v, 0, most) >> voxel_shift for v in p) for p in points]
    side = step / 512
    xyz = [[schema["origin"][d] + float(16 * base[d] + p[d]) * side for d in range(3)] for p in points]
    if schema["coordinates"] == 1:
        xyz = [list(struct.unpack("<3f", struct.pack("<3f", *p))) for p in xyz]
    return xyz, voxels
