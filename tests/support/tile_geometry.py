# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, sections 5 and 6: geometry of `lossless` and `points` tiles. Slow and plain; see read_tile.py."""
import math
import struct

from read_archive import Damaged, Reader
from tile_channels import lattice_value, to_float32
from tile_entropy import BitModel, IntegerModel, MagnitudeModel, Mixer, Models, RangeDecoder


# --- 5. `lossless` geometry ---------------------------------------------------------------------------------------

class BitReader:
    def __init__(self, data):
        self.bits, self.left = int.from_bytes(data, "big"), 8 * len(data)

    def get(self, count):
        if count > self.left:
            raise Damaged("plain bits end too early")
        self.left -= count
        return self.bits >> self.left & ((1 << count) - 1)


class Grid:
    """The numbers of one axis, cut into cells."""

    def __init__(self, r, schema, axis):
        self.kind = r.uint(1)
        if self.kind not in (0, 1, 17, 18, 19, 20):
            raise Damaged("unknown grid")
        n = r.uint(1) if 17 <= self.kind <= 19 else 0
        self.e = r.signed()
        self.is_float = self.kind <= 1
        self.single = schema["coordinates"] == 1
        self.lattice = (self.kind - 16, n, 0.0)
        if self.kind == 20:
            self.lattice = (4, schema["scale"][axis], schema["offset"][axis])
        self.mantissa, self.bias, self.width = ((23, 127, 4), (52, 1023, 8))[self.kind == 1]

    def number_bits(self, magnitude):
        return int.from_bytes(struct.pack("<f" if self.width == 4 else "<d", magnitude), "little")

    def number(self, bits, negative):
        data = (bits | negative << (8 * self.width - 1)).to_bytes(self.width, "little")
        return struct.unpack("<f" if self.width == 4 else "<d", data)[0]

    def read(self, cell, depth_model, side, rest):
        if not self.is_float:
            k = cell << self.e | rest.get(self.e) if self.e > 0 else cell >> -self.e
            v = lattice_value(self.lattice, k)
            return to_float32(v) if self.single else v
        negative = int(cell < 0)
        j = -1 - cell if negative else cell
        if j > 0:
            first = self.number_bits(math.ldexp(j, self.e))
            return self.number(first + rest.get(max(0, self.mantissa + 1 - j.bit_length())), negative)
        exponent = self.e + self.bias - (depth_model.decode(side) + 1)
        if exponent < 0:
            raise Damaged("a number below the smallest")
        return self.number((exponent << self.mantissa) + rest.get(self.mantissa), negative)


def read_finite(r, count, schema, xyz, voxels):
    grids = [Grid(r, schema, axis) for axis in range(3)]
    base = [r.signed() for _ in range(3)]
    depth = r.uint(1)
    cells = read_octree(r.sized(), depth, count)
    side, rest, patches = RangeDecoder(r.sized()), BitReader(r.sized()), Reader(r.sized())
    repeat_models, depth_models, repeated = Models(), Models(MagnitudeModel), 0
    for i, voxel in enumerate(cells):
        if i > 0 and voxel == cells[i - 1]:
            repeated = side.bit(repeat_models[repeated])
            if repeated:
                xyz.append(list(xyz[-1]))
                continue
        xyz.append([grids[a].read(base[a] + voxel[a], depth_models[a], side, rest) for a in range(3)])
    at = 0
    while patches.left():
        s = patches.varint()
        at += s // 3
        xyz[at][s % 3] = patches.f64()
    voxels += cells


def read_odd(d, count, xyz, voxels):
    last, repeat, models = [0.0] * 3, BitModel(), Models()
    for _ in range(count):
        if not d.bit(repeat):
            for axis in range(3):
                data = bytes(d.tree(models, (axis, b), 8) for b in range(8))
                last[axis] = struct.unpack(">d", data)[0]
        xyz.append(list(last))
        voxels.append(voxels[-1] if voxels else (0, 0, 0))


def read_lossless(data, count, schema):
    """Coordinates and voxels, one of each per point."""
    r, xyz, voxels = Reader(data), [], []
    odd = r.varint()
    if odd < count:
        read_finite(r, count - odd, schema, xyz, voxels)
    if odd > 0:
        read_odd(RangeDecoder(r.raw(r.left())), odd, xyz, voxels)
    return xyz, voxels


# --- 6. `points` geometry -----------------------------------------------------------------------------------------

def read_points(data, count, schema, step):
    """Coordinates and voxels, one of each per point."""
    r = Reader(data)
    base = [r.signed() for _ in range(3)]
    depth = r.uint(1)
    voxels = read_octree(r.raw(r.left()), depth, count)
    round_to = to_float32 if schema["coordinates"] == 1 else float
    origin = schema["origin"]
    return [[round_to(origin[a] + (base[a] + v[a] + 0.5) * step) for a in range(3)] for v in voxels], voxels


# --- 6.2 Octree stream ---------------------------------------------------------------------------------------------

class Node:
    def __init__(self, at, siblings, single):
        self.at, self.siblings, self.single = at, siblings, single


def read_octree(data, depth, points):
    """The voxel of each point."""
    mode, d = data[0], RangeDecoder(data[1:])
    tail = mode >> 3
    if depth > 21 or tail > depth:
        raise Damaged("an octree of impossible depth")
    tree = Occupancy(d, mixing=mode & 1, singles=mode & 4)
    nodes = [Node((0, 0, 0), 0, False)]
    for level in range(depth - tail):
        nodes = tree.descend(nodes, depth - tail - level)
    leaves = [n.at for n in nodes]
    counts = read_counts(d, leaves) if mode & 2 else [1] * len(leaves)
    if sum(counts) != points:
        raise Damaged("an octree holds another number of points than declared")
    return read_tails(d, leaves, counts, tail)


def halves(axis, mask):
    low = (0x55, 0x33, 0x0F)[axis]
    return int(mask & low != 0) + 2 * int(mask & ~low & 255 != 0)


def beside(at, axis, by):
    return tuple(x + by if a == axis else x for a, x in enumerate(at))


def child_at(at, i):
    return tuple(2 * x + (i >> a & 1) for a, x in enumerate(at))


# --- 6.3 Occupancy ---------------------------------------------------------------------------------------------------

class Around:
    """What is known around a node before it is coded."""

    def __init__(self, at, masks, level, slab):
        self.before = [masks.get(beside(at, a, -1), 0) for a in range(3)]
        self.after = [int(beside(at, a, 1) in level) for a in range(3)]
        self.slab = [slab[a].get(at[a], 0) for a in range(3)]
        self.faces = sum(b != 0 for b in self.before) + sum(self.after)

    def touch(self, i):
        t = [self.after[a] if i >> a & 1 else 0 if self.before[a] == 0 else 1 + (self.before[a] >> (i + (1 << a)) & 1)
             for a in range(3)]
        return t[0] + 3 * t[1] + 9 * t[2]

    def slab_bits(self, i):
        return sum((self.slab[a] >> (i >> a & 1) & 1) << a for a in range(3))


class Occupancy:
    def __init__(self, d, mixing, singles):
        self.d, self.mixing, self.singles = d, mixing, singles
        self.occupancy, self.by_slab, self.by_size, self.flag, self.single = (Models() for _ in range(5))
        self.mixers = [Mixer() for _ in range(8)]

    def descend(self, nodes, r):
        """The children of a level's nodes; r levels lie below it."""
        level, masks, slab, children = {n.at for n in nodes}, {}, [{}, {}, {}], []
        for node in nodes:
            around = Around(node.at, masks, level, slab)
            if self.singles and r >= 2 and not node.single:
                node.single = bool(self.d.bit(self.flag[(min(r, 8) - 1) * 63 + around.faces * 9 + node.siblings]))
            mask = self.single_mask(around) if node.single else self.mask(node, around, r)
            masks[node.at] = mask
            for a in range(3):
                slab[a][node.at[a]] = halves(a, mask)
            siblings = bin(mask).count("1")
            children += [Node(child_at(node.at, i), siblings, node.single) for i in range(8) if mask >> i & 1]
        return children

    def single_mask(self, around):
        child = 0
        for a in (2, 1, 0):
            b, c = ((1, 2), (0, 2), (0, 1))[a]
            t = 0 if around.before[a] == 0 else 1 + (halves(a, around.before[a]) >> 1)
            context = ((a * 4 + around.slab[a]) * 3 + t) * 2 + around.after[a]
            context = (context * 4 + halves(a, around.before[b])) * 4 + halves(a, around.before[c])
            child |= self.d.bit(self.single[context]) << a
        return 1 << child

    def mask(self, node, around, r):
        h, mask = 1, 0
        size = 8 * max(node.siblings - 1, 0) + min(r, 8) - 1
        for i in range(8):
            if h == 128:
                return 128
            models = [self.occupancy[27 * h + around.touch(i)]]
            if self.mixing:
                models += [self.by_slab[8 * h + around.slab_bits(i)], self.by_size[64 * h + size]]
                bit = self.mixers[i].decode(self.d, models)
            else:
                bit = self.d.bit(models[0])
            h, mask = 2 * h + bit, mask | bit << i
        return mask


# --- 6.4 Counts ------------------------------------------------------------------------------------------------------

def read_counts(d, leaves):
    level, counts, previous = set(leaves), {}, 1
    more, large, rest = Models(), Models(IntegerModel), IntegerModel()
    for leaf in leaves:
        around = [counts.get(beside(leaf, a, -1), 0) for a in range(3)]
        faces = sum(n != 0 for n in around) + sum(beside(leaf, a, 1) in level for a in range(3))
        total, terms = previous + sum(around), 1 + sum(n != 0 for n in around)
        if total > 8 * terms:
            n = 1 + large[min((total // terms).bit_length(), 11) - 4].decode(d)
        else:
            q = sum(4 * total > t * terms for t in (4, 5, 6, 8, 12, 20))
            n = 1
            while n <= 16 and d.bit(more[(7 * q + faces) * 16 + n - 1]):
                n += 1
            if n == 17:
                n += rest.decode(d)
        counts[leaf] = previous = n
    return [counts[leaf] for leaf in leaves]


# --- 6.5 Tail --------------------------------------------------------------------------------------------------------

def read_tails(d, leaves, counts, tail):
    voxels = []
    for leaf, count in zip(leaves, counts):
        last = 0
        for _ in range(count):
            key = d.raw(3 * tail)
            if key < last:
                raise Damaged("a tail is not in order")
            last = key
            low = [sum((key >> (3 * i + a) & 1) << i for i in range(tail)) for a in range(3)]
            voxels.append(tuple(x << tail | low[a] for a, x in enumerate(leaf)))
    return voxels
