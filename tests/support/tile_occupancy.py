# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, section 12: occupancy tiles. Slow and plain; see read_tile.py."""
import struct

from read_archive import Damaged, Reader
from tile_entropy import BitModel, Mixer, Models, RangeDecoder, clamp

M32 = (1 << 32) - 1
OFFSETS = [(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1),
           (-1, -1, 0), (1, -1, 0), (-1, 1, 0), (1, 1, 0), (-1, 0, -1), (1, 0, -1), (-1, 0, 1), (1, 0, 1),
           (0, -1, -1), (0, 1, -1), (0, -1, 1), (0, 1, 1)]
NO_COLOR = (255, 255, 255)


def join(a, b):
    return (((a * 0x85EBCA6B) & M32 ^ b) * 0xC2B2AE35 + 0x27D4EB2F) & M32


class Rows:
    """A table of 2^bits models, found by hashing."""

    def __init__(self, symbols, most):
        self.bits, self.models = clamp(symbols.bit_length(), 8, most), Models()

    def model(self, key, size=1, within=0):
        return self.models[(((key * 0x2545F491) & M32) >> (32 - self.bits)) // size * size + within]


class Tables:
    def __init__(self, symbols, most):
        self.rows, self.mixers = [Rows(symbols, most) for _ in range(3)], {}

    def mixed(self, d, keys, mixer, size=1, within=0):
        mix = self.mixers.setdefault(mixer, Mixer())
        return mix.decode(d, [r.model(k, size, within) for r, k in zip(self.rows, keys)])


def cell_at(nodes, larger, height, place):
    """Cell of the child at `place` (children's units); 3 where its parent is not coded. nodes: coded ones by place; larger: cells by (height, place)."""
    parent = tuple(v >> 1 for v in place)
    if parent in nodes:
        word = nodes[parent]
        return 3 if word is None else word >> 2 * ((place[0] & 1) | (place[1] & 1) << 1 | (place[2] & 1) << 2) & 3
    for h in range(height, 17):  # a leaf that contains the parent, if any
        up = larger.get((h, tuple(v >> (h - height) for v in parent)))
        if up is not None:
            return up
    return 0


class TreeReader:
    def __init__(self, section, leaves):
        r = Reader(section)
        form, self.height = r.uint(1), r.uint(1)
        self.key = [r.varint() for _ in range(3)]
        self.inner, self.leaves = r.varint(), leaves
        self.kind, self.root, self.exceptions = form & 3, form >> 2 & 3, form >> 4
        self.table, self.escapes = [], 0
        if self.kind > 1:
            head, t = r.varint(), -1
            self.escapes = head & 1
            for _ in range(head >> 1):
                t += r.varint() + 1
                self.table.append(t & 0x7FFFFFFF if t >> 31 else ~t & M32)
        self.d = RangeDecoder(r.raw(r.left()))
        self.structure = Tables(2 * self.inner, 16)
        self.values, self.colors = Tables(2 * leaves, 18), Tables(2 * leaves, 16)
        self.has_color = [BitModel() for _ in range(6)]
        self.last = 0
        self.found = {}  # (height, place) of leaves: cell, value, colour

    def read(self):
        if self.root != 3:
            self.read_leaves({(0, 0, 0): self.root}, {}, self.height + 1)
            return self.found
        level, larger = [(0, 0, 0)], {}
        for h in range(self.height, 0, -1):
            nodes = dict.fromkeys(level)
            for place in level:
                nodes[place] = self.read_node(nodes, larger, h, place)
            self.read_leaves(nodes, larger, h)
            below = []
            for place in level:
                for c in range(8):
                    cell, child = nodes[place] >> 2 * c & 3, self.child(place, c)
                    if cell == 3:
                        below.append(child)
                    elif cell:
                        larger[h - 1, child] = cell
            level = below
        if level or sum(1 for _ in self.found) != self.leaves:
            raise Damaged("an octree with another number of nodes")
        return self.found

    @staticmethod
    def child(place, c):
        return (2 * place[0] + (c & 1), 2 * place[1] + (c >> 1 & 1), 2 * place[2] + (c >> 2))

    # 12.2
    def read_node(self, nodes, larger, h, place):
        s, own = min(h, 4) - 1, 0
        for c in range(8):
            def beyond(child, axes):
                p = list(self.child(place, child))
                for d in axes:
                    p[d] += 2 * (child >> d & 1) - 1
                return cell_at(nodes, larger, h, tuple(p))
            sibling = lambda j: own >> 2 * j & 3 if j < c else 3
            faces = beyond(c, [0]) + 4 * beyond(c, [1]) + 16 * beyond(c, [2])
            own3 = sibling(c ^ 1) + 4 * sibling(c ^ 2) + 16 * sibling(c ^ 4)
            edges = (beyond(c ^ 2, [0]) + 4 * beyond(c ^ 4, [0]) + 16 * beyond(c ^ 1, [1]) + 64 * beyond(c ^ 4, [1])
                     + 256 * beyond(c ^ 1, [2]) + 1024 * beyond(c ^ 2, [2]))
            corners = beyond(c, [0, 1]) + 4 * beyond(c, [0, 2]) + 16 * beyond(c, [1, 2])
            history = own | 1 << 2 * c
            keys = [((3 * history + 0x10001 * s) * 0x9E3779B1 ^ s * 0x7F4A7C15) & M32,
                    ((64 * history + faces) * 0x85EBCA6B ^ s * 0xC2B2AE35) & M32,
                    ((((faces | own3 << 6 | edges << 12 | corners << 24) & M32) * 0x9E3779B1 + corners * 0x27D4EB2F) ^ s * 0x165667B1) & M32]
            ask = lambda n: self.structure.mixed(self.d, keys, (8 * s + c) * 3 + n, 4, n)
            if h > 1 and ask(0):
                cell = 3
            elif ask(1):
                cell = 0
            else:
                cell = 2 if ask(2) else 1
            own |= cell << 2 * c
        if own == 0:
            raise Damaged("an inner node without children")
        return own

    # 12.3, 12.4
    def read_leaves(self, nodes, larger, h):
        symbols, colors = {}, {}
        for place, node in nodes.items():
            for c in range(8):
                cell, at = node >> 2 * c & 3, self.child(place, c)
                if cell in (0, 3):
                    continue
                value = color = None
                if self.kind > 1:
                    around = [tuple(a + b for a, b in zip(at, o)) for o in OFFSETS]
                    cells = [cell_at(nodes, larger, h, p) for p in around]
                    value = self.read_value(symbols, around, cells, at, cell == 2, min(h - 1, 3))
                    if self.kind == 3:
                        color = colors[at] = self.read_color(colors, around, cell == 2)
                self.found[h - 1, at] = cell, value, color

    def read_value(self, symbols, around, cells, at, occupied, s):
        v = [3 + symbols[p] if p in symbols else c % 3 for p, c in zip(around, cells)]
        seen = [symbols[p] for p in around if p in symbols]
        mean = (2 * sum(seen) + len(seen)) // (2 * len(seen)) + 1 if seen else 0
        keys = [join(join(v[0], v[2]), v[4]), join(8 * cells[:6].count(1) + cells[:6].count(2), 2 * self.last + 1),
                join(join(v[6], v[10]), join(v[14], mean))]
        count = len(self.table) + self.escapes
        node, bits = 1, (count - 1).bit_length()
        for _ in range(bits):
            b = join(2 * node + occupied, s)
            mixer = min(node, 31) * 4 + occupied * 2 + (s > 0)
            node = 2 * node + self.values.mixed(self.d, [join(b, k) for k in keys], mixer)
        self.last = symbols[at] = node - (1 << bits)
        if self.escapes and self.last == len(self.table):
            return self.d.raw(32)
        return self.table[self.last]

    def read_color(self, colors, around, occupied):
        near = [(colors[p], 8 if o < 6 else 5) for o, p in enumerate(around) if colors.get(p, NO_COLOR) != NO_COLOR]
        n = len(near)
        if not self.d.bit(self.has_color[3 * occupied + min(n, 2)]):
            return NO_COLOR
        guess, spread = [128] * 3, [40] * 3
        if n:
            w = sum(weight for _, weight in near)
            guess = [(2 * sum(k * color[i] for color, k in near) + w) // (2 * w) for i in range(3)]
            spread = [sum(abs(color[i] - guess[i]) for color, _ in near) // n for i in range(3)]
        result, d = [0] * 3, [0, 0]
        for q, i in enumerate((1, 0, 2)):
            shift = (0, d[0], int((d[0] + d[1]) / 2))[q]
            p = clamp(guess[i] + shift, 0, 255)
            step = spread[i] if spread[i] <= 8 else 9 if spread[i] < 16 else 10 if spread[i] < 32 else 11
            first, second = (abs(v).bit_length() for v in d)
            contexts = [8 * step + min(n, 7), 256 * step + 16 * first + second, min(sum(spread), 127) // 2]
            result[i] = p + self.read_difference(q, contexts)
            d[0 if q == 0 else 1] = result[i] - guess[i]
        return tuple(result)

    def read_difference(self, q, contexts):
        def ask(t):
            b = 4 * t + q
            return self.colors.mixed(self.d, [join(b, c) for c in contexts], min(t, 17) * 3 + q)
        k = 0
        while k < 8 and ask(k):
            k += 1
        if k == 0:
            return 0
        negative, v = ask(8 + k), 1
        for _ in range(k - 1):
            v = 2 * v + ask(256 * k + v + 256)
        return -v if negative else v


def read_occupancy(section, count, schema):
    """Centres of the leaves depth first, and the channels of an octree's schema."""
    tree = TreeReader(section, count)
    found, base = tree.read(), [k << tree.height for k in tree.key]
    def order(item):  # depth first: by the corner's Morton order
        (h, place), _ = item
        corner = [base[d] + (place[d] << h) for d in range(3)]
        return sum((corner[d] >> i & 1) << 3 * i + d for i in range(16) for d in range(3))
    xyz, channels = [], {c["name"]: [] for c in schema["channels"]}
    for (h, place), (cell, value, color) in sorted(found.items(), key=order):
        xyz.append(tuple((base[d] + (place[d] << h) + (1 << h) / 2 - 32768) * schema["tile_size"] for d in range(3)))
        channels["height"].append(bytes([h]))
        if tree.kind == 1:
            channels["occupied"].append(bytes([cell == 2]))
        else:
            channels["log_odds"].append(struct.pack("<I", value))
        if tree.kind == 3:
            channels["rgb"].append(bytes(color))
    return xyz, channels
