# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, section 12: occupancy tiles. Slow and plain; see read_tile.py."""
import struct

from read_archive import Damaged, Reader
from tile_entropy import BitModel, Mixer, Models, NibbleModel, RangeDecoder, SymbolDecoder, clamp

M32 = (1 << 32) - 1
BEFORE = [(-1, 0, 0), (0, -1, 0), (0, 0, -1), (-1, -1, 0), (-1, 0, -1), (0, -1, -1),
          (1, -1, 0), (1, 0, -1), (0, 1, -1), (-1, 1, 0), (-1, 0, 1), (0, -1, 1)]
NO_COLOR = (255, 255, 255)


def is_occupied(bits):
    """NaN is, and so is -0."""
    return int(not struct.unpack("<f", struct.pack("<I", bits))[0] < 0)


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
        self.kind, self.root, self.exceptions = form & 3, form >> 2 & 3, form >> 4 & 1
        self.valued = self.kind > 1
        if form >> 5 != self.valued:
            raise Damaged("an octree in another form")
        self.ranked = [[], []]  # class: (bit length, value) by rank; value None: the escape
        if self.valued:
            self.read_table(r)
        data = r.raw(r.left())
        self.d = SymbolDecoder(data) if self.valued else RangeDecoder(data)
        self.structure = Tables(2 * self.inner, 16)
        self.near, self.rows = Models(NibbleModel), Models(NibbleModel)
        self.row_bits = clamp(self.inner.bit_length(), 6, 13)
        self.values = [Models(lambda o=o: NibbleModel([1 << w - 1 for w, _ in self.ranked[o]])) for o in range(2)]
        self.tails, self.has_color, self.last = Models(NibbleModel), Models(), [0, 0]
        self.colors = Models(NibbleModel)
        self.found = {}  # (height, place) of leaves: cell, value, colour

    def read_table(self, r):
        head, t, table = r.varint(), -1, []
        for _ in range(head >> 1):
            t += r.varint() + 1
            table.append((r.uint(1), t & 0x7FFFFFFF if t >> 31 else ~t & M32))
        for weight, value in table:
            self.ranked[is_occupied(value)].append((weight, value))
        escapes = r.uint(1) if head & 1 else 0
        for o in range(2):
            self.ranked[o].sort(key=lambda e: -e[0])
            self.ranked[o] += [(escapes, None)] * (head & 1)

    def read(self):
        found = self.read_tree()
        if self.valued:
            self.end()
        return found

    def end(self):
        """12.6 is not read: what inner nodes hold is no part of a cloud."""
        if not self.exceptions:
            self.d.end()

    def read_tree(self):
        if self.root != 3:
            self.read_leaves({(0, 0, 0): self.root}, {}, self.height + 1)
            return self.found
        level, larger = [(0, 0, 0)], {}
        for h in range(self.height, 0, -1):
            nodes = dict.fromkeys(level)
            for place in level:
                nodes[place] = (self.read_pairs if self.valued else self.read_node)(nodes, larger, h, place)
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

    # 12.3
    def read_pairs(self, nodes, larger, h, place):
        own = []
        for p in range(4):
            def pair(axis):
                v = 0
                for c in (2 * p, 2 * p + 1):
                    at = list(self.child(place, c))
                    at[axis] += 2 * (c >> axis & 1) - 1
                    v |= cell_at(nodes, larger, h, tuple(at)) << 2 * (c & 1)
                return v
            x, y, z, v, w = pair(0), pair(1), pair(2), 0, 0
            if p & 1:
                y, v = own[p ^ 1], y
            if p & 2:
                z, w = own[p ^ 2], z
            q = 4 * (min(h, 3) - 1) + p
            key = x + 16 * y + (z << 8) + (v << 12) + (w << 16) + (q << 20)
            row = (key * 0x9E3779B1 & M32) >> (32 - self.row_bits)
            own.append(self.d.symbol(self.near[q, z, y], self.rows[row]))
        node = sum(s << 4 * p for p, s in enumerate(own))
        if node == 0:
            raise Damaged("an inner node without children")
        return node

    # 12.4, 12.5
    def read_leaves(self, nodes, larger, h):
        ranks, colors = {}, {}
        for place, node in nodes.items():
            for c in range(8):
                cell, at = node >> 2 * c & 3, self.child(place, c)
                if cell in (0, 3):
                    continue
                value = color = None
                if self.valued:
                    before = [tuple(a + b for a, b in zip(at, o)) for o in BEFORE]
                    o = int(cell == 2)
                    rank, value = self.read_value(ranks, before, o, h > 1)
                    ranks[at] = o, rank
                    if self.kind == 3:
                        color = colors[at] = self.read_color(colors, before, o, rank)
                self.found[h - 1, at] = cell, value, color

    def read_value(self, ranks, before, o, large):
        table, rank = self.ranked[o], 0
        if len(table) > 1:
            near = [1 + min(ranks[p][1], 15) for p in before if p in ranks and ranks[p][0] == o] + [0, 0]
            rank = self.d.symbol(self.values[o][large, near[0], near[1]])
            if rank == 15 and len(table) > 16:
                v = 0
                for digit in reversed(range(((len(table) - 16).bit_length() + 3) // 4)):
                    v = 16 * v + self.d.symbol(self.tails[o, digit, v & 15])
                rank += v
        if rank >= len(table):
            raise Damaged("an unknown log-odds")
        value = table[rank][1]
        if value is None:
            value = self.d.raw(16) << 16
            value |= self.d.raw(16)
        return rank, value

    def read_color(self, colors, before, o, rank):
        self.last[o] = self.d.bit(self.has_color[o, min(rank, 31), self.last[o]])
        if not self.last[o]:
            return NO_COLOR
        near = [(colors[p], 8 if i < 3 else 5) for i, p in enumerate(before) if colors.get(p, NO_COLOR) != NO_COLOR]
        n, guess, spread = len(near), [128] * 3, 40
        if n:
            w = sum(weight for _, weight in near)
            guess = [(2 * sum(k * color[i] for color, k in near) + w) // (2 * w) for i in range(3)]
            spread = sum(abs(color[1] - guess[1]) for color, _ in near) // n
        spread = spread if spread <= 8 else 9 if spread < 16 else 10 if spread < 32 else 11
        result, d = [0] * 3, [0, 0]
        for q, i in enumerate((1, 0, 2)):
            shift = (0, d[0], int((d[0] + d[1]) / 2))[q]
            p = clamp(guess[i] + shift, 0, 255)
            first, second = (abs(v).bit_length() for v in d)
            context = ((0, spread, min(n, 7)), (1, first), (2, first, second))[q]
            result[i] = p + self.read_difference(self.colors[context])
            d[0 if q == 0 else 1] = result[i] - guess[i]
        return tuple(result)

    def read_difference(self, model):
        c = self.d.symbol(model)
        if c == 0:
            return 0
        k = 0 if c < 4 else c // 2 - 1
        rest = self.d.raw(k + 1)
        v = (c if c < 4 else (2 + c % 2) << k) + (rest >> 1)
        return -v if rest & 1 else v


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
