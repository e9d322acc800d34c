# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, section 8: the channels of a tile. Slow and plain; see read_tile.py."""
import math
import struct

from read_archive import Damaged, Reader
from tile_entropy import M64, BitModel, MagnitudeModel, Mixer, Models, RangeDecoder, clamp

SCALAR_SIZE = (0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8)
F32, F64 = 9, 10


def read_channel(data, channel, voxels):
    """The bytes of one value per point."""
    if data[0] == 1:
        return read_values(Reader(data[1:]), channel, voxels)
    if data[0] == 0 and channel["name"] == "rgb" and channel["components"] == 3 and channel["scalar"] in (1, 3):
        return read_colors(Reader(data[1:]), channel, voxels)
    raise Damaged("an unknown channel section")


# --- 8.1 Number lattices --------------------------------------------------------------------------------------------

def to_float32(v):
    return struct.unpack("<f", struct.pack("<f", v))[0]


def lattice_value(lattice, k):
    kind, a, b = lattice
    if kind == 1:
        return k / 10.0**a
    if kind == 2:
        return math.ldexp(k, -a)
    if kind == 3:
        return to_float32(to_float32(k) * to_float32(float(f"1e-{a}")))
    if kind == 4:
        return float(k) * a + b
    return float(k) * a


# --- 8.2 Ordered bits -----------------------------------------------------------------------------------------------

def sign_bit(scalar):
    return 1 << (8 * SCALAR_SIZE[scalar] - 1)


def ordered_bits_of_float(v, scalar):
    bits = int.from_bytes(struct.pack("<f" if scalar == F32 else "<d", v), "little")
    sign = sign_bit(scalar)
    return 2 * sign - 1 - bits if bits & sign else bits | sign


def scalar_bytes(ordered, scalar):
    sign = sign_bit(scalar)
    ordered &= 2 * sign - 1
    if scalar >= F32:
        ordered = ordered ^ sign if ordered & sign else 2 * sign - 1 - ordered
    elif scalar % 2 == 0:
        ordered ^= sign
    return ordered.to_bytes(SCALAR_SIZE[scalar], "little")


# --- 8.3 "Values" sections ------------------------------------------------------------------------------------------

class Plan:
    """How one component's values became small integers, and its contexts."""

    def __init__(self, r, scalar):
        flags = r.uint(1)
        self.scalar = scalar
        self.on_lattice, self.escapes, self.predictor = flags & 1, flags & 2, flags >> 4 & 3
        if self.on_lattice:
            kind = r.uint(1)
            self.lattice = (kind, r.f64() if kind == 5 else r.uint(1), 0.0)
        self.base = (r.signed() if self.on_lattice else r.varint())
        self.divisor, self.most = r.varint(), r.varint()
        self.palette = []
        if flags & 4:
            for _ in range(r.varint() + 1):
                self.palette.append((self.palette[-1] if self.palette else 0) + r.varint())
        self.cross = [struct.unpack("b", r.raw(1))[0] for _ in range(3)] if flags & 8 else [0, 0, 0]
        self.most_coded = len(self.palette) - 1 if self.palette else self.most
        self.zero, self.sign, self.magnitude = Models(), Models(), Models(MagnitudeModel)
        self.seen, self.names, self.escape = Models(), Models(), Models()
        self.last_escape = self.escaped = 0

    def ordered_bits(self, u):
        u = self.palette[u] if self.palette else u
        key = self.base + u * self.divisor
        if not self.on_lattice:
            return min(key & M64, 2 * sign_bit(self.scalar) - 1)
        k = (key + (1 << 63) & M64) - (1 << 63)
        value = lattice_value(self.lattice, k)
        return ordered_bits_of_float(value, self.scalar)


def activity_bucket(a):
    if a < 2:
        return a
    width = a.bit_length()
    return min(17, 2 * width - 2 + (a >> (width - 2) & 1))


class Values:
    def __init__(self, plans, d, voxels):
        self.plans, self.d = plans, d
        self.u = [[0] * len(plans) for _ in voxels]
        self.residuals = [[0] * len(plans) for _ in voxels]
        self.escapes = {}
        self.neighbors = Neighbors(voxels)

    def read_point(self, i):
        around = self.neighbors.find(i)
        deviations, first = [0, 0, 0], 0
        for c, plan in enumerate(self.plans):
            before = self.u[i - 1][c] if i > 0 else None
            if plan.escapes and self.read_escape(i, c, plan):
                self.u[i][c] = before or 0
                continue
            if plan.most_coded == 0:
                continue
            if plan.predictor == 0:
                u = self.d.raw(plan.most_coded.bit_length())
            elif plan.predictor == 3:
                u = self.read_category(c, plan, around)
            elif plan.predictor == 1:
                predicted = plan.most_coded // 2 if before is None else before
                activity = self.residuals[i - 1][c] if i > 0 else 0
                u = self.read_residual(i, c, plan, predicted, activity, first)
            else:
                mean = self.mean(c, plan, around)
                predicted = mean
                if plan.most_coded < 1 << 32:
                    predicted = 16 * mean + 8 + sum(x * y for x, y in zip(plan.cross, deviations))
                    predicted = clamp(predicted >> 4, 0, plan.most_coded)
                activity = 2 * sum(self.residuals[n][c] for n, _ in around) // max(1, len(around))
                u = self.read_residual(i, c, plan, predicted, activity, first)
                if plan.most_coded < 1 << 32 and c < 3:
                    deviations[c] = u - mean
            if u > plan.most_coded:
                raise Damaged("a value above the largest")
            self.u[i][c] = u
            first = min(5, max(first, self.residuals[i][c].bit_length()))

    def read_escape(self, i, c, plan):
        plan.escaped = self.d.bit(plan.escape[plan.escaped])
        if not plan.escaped:
            return False
        if not self.d.bit(plan.escape[2]):
            plan.last_escape = self.d.raw(64)
        self.escapes[i, c] = plan.last_escape
        return True

    def read_category(self, c, plan, around):
        seen = {}
        for n, _ in around:
            v = self.u[n][c]
            if v in seen or len(seen) < 3:
                seen[v] = seen.get(v, 0) + 1
        for k, (v, votes) in enumerate(seen.items()):
            if self.d.bit(plan.seen[4 * k + min(votes, 4) - 1]):
                return v
        return self.d.tree(plan.names, (), 8)

    def read_residual(self, i, c, plan, predicted, activity, first):
        context = activity_bucket(activity), first
        if self.d.bit(plan.zero[context]):
            return predicted
        negative = self.d.bit(plan.sign[context])
        magnitude = plan.magnitude[context].decode(self.d) + 1
        self.residuals[i][c] = min(magnitude, 1 << 30)
        return (predicted - magnitude if negative else predicted + magnitude) & M64

    def mean(self, c, plan, around):
        if not around:
            return plan.most_coded // 2
        nearest, d0 = self.u[around[0][0]][c], around[0][1]
        total, weights = 0, 256
        for n, d in around[1:]:
            weight = 256 * (d0 + 1) // (d + 1)
            off = (self.u[n][c] - nearest + (1 << 63) & M64) - (1 << 63)
            if abs(off) < 1 << 48:
                total, weights = total + off * weight, weights + weight
        return (nearest + toward_zero(total + (weights // 2 if total >= 0 else -(weights // 2)), weights)) & M64


def toward_zero(a, b):
    return a // b if a >= 0 else -(-a // b)


def read_values(r, channel, voxels):
    scalar, components = channel["scalar"], channel["components"]
    plans = [Plan(r, scalar) for _ in range(components)]
    values = Values(plans, RangeDecoder(r.raw(r.left())), voxels)
    order = [1, 0, 2] if channel["name"] == "rgb" and components == 3 else list(range(components))
    out = []
    for i in range(len(voxels)):
        values.read_point(i)
        row = [b""] * components
        for c, plan in enumerate(plans):
            ordered = values.escapes[i, c] if (i, c) in values.escapes else plan.ordered_bits(values.u[i][c])
            row[order[c]] = scalar_bytes(ordered, scalar)
        out.append(b"".join(row))
    return out


# --- 8.4 Neighbours -------------------------------------------------------------------------------------------------

def splits(voxels):
    """[l]: neighbouring points that share a cell of 2^l voxels, but none of 2^(l-1)."""
    out = [0] * 22
    for p, q in zip(voxels, voxels[1:]):
        out[((p[0] ^ q[0]) | (p[1] ^ q[1]) | (p[2] ^ q[2])).bit_length()] += 1
    return out


class Neighbors:
    """Of each point the nearest ones before it. Ask for 0, 1, 2, ... in turn."""

    def __init__(self, voxels):
        self.voxels, self.shift, parts, cells = voxels, 0, splits(voxels), 1
        for s in range(21, 0, -1):
            if 2 * (cells + parts[s]) > len(voxels):
                self.shift = s
                break
            cells += parts[s]
        self.slots = [None] * (1 << (2 * cells + 1).bit_length())
        self.begins, self.candidates = [], []

    def cell(self, i):
        return tuple(x >> self.shift for x in self.voxels[i])

    def probes(self, cell):
        key = cell[0] + (cell[1] << 21) + (cell[2] << 42)
        h = key * 0x9E3779B97F4A7C15 & M64
        first = ((h ^ h >> 29) * 0xBF58476D & M64) >> 7
        return [(first + n) % len(self.slots) for n in range(16)]

    def look_up(self, cell):
        for at in self.probes(cell):
            if self.slots[at] is None:
                return None
            if self.slots[at][0] == cell:
                return self.slots[at][1]
        return None

    def insert(self, cell, number):
        for at in self.probes(cell):
            if self.slots[at] is None:
                self.slots[at] = (cell, number)
                return

    def begin_cell(self, i):
        cell = self.cell(i)
        self.begins.append(i)
        self.candidates = []
        for n in range(27):
            to = (cell[0] + n % 3 - 1, cell[1] + n // 3 % 3 - 1, cell[2] + n // 9 - 1)
            if n == 13 or min(to) < 0 or max(to) >= 1 << 21:
                continue
            found = self.look_up(to)
            if found is not None:
                begin, m = self.begins[found], self.begins[found + 1] - self.begins[found]
                t = min(m, 3)
                self.candidates += [begin + m * (2 * k + 1) // (2 * t) for k in range(t)]
        self.insert(cell, len(self.begins) - 1)

    def find(self, i):
        """(index, squared distance), nearest first."""
        if i == 0 or self.cell(i) != self.cell(i - 1):
            self.begin_cell(i)
        begin = self.begins[-1]
        offered = [*range(i - 1, max(begin, i - 8) - 1, -1), *self.candidates]
        if i == begin and i > 0 and len(offered) < 6 and i - 1 not in offered:
            offered.append(i - 1)
        distance = lambda j: sum((x - y) ** 2 for x, y in zip(self.voxels[i], self.voxels[j]))
        return sorted(((j, distance(j)) for j in offered), key=lambda n: n[1])[:6]


# --- 8.5 "Colour" sections ------------------------------------------------------------------------------------------

class Cell:
    def __init__(self, at, begin, children):
        self.at, self.begin, self.children = at, begin, children  # children: octant -> Cell
        self.mean, self.above, self.activity, self.place = None, 0, 0, 0
        self.weight = 0


def build_tree(voxels):
    """Levels of cells in Morton order, the root first."""
    parts, count = splits(voxels), len(voxels)
    whole = count - parts[0]
    cells, g = whole, 0
    while g < 21 and 16 * (cells - parts[g + 1]) >= 15 * whole:
        g += 1
        cells -= parts[g]
    level = []
    for i, v in enumerate(voxels):
        at = tuple(x >> g for x in v)
        if not level or level[-1].at != at:
            level.append(Cell(at, i, {}))
        level[-1].weight += 1
    levels = [level]
    while len(levels[0]) > 1:
        above = []
        for cell in levels[0]:
            at = tuple(x >> 1 for x in cell.at)
            if not above or above[-1].at != at:
                above.append(Cell(at, cell.begin, {}))
            octant = sum((x & 1) << a for a, x in enumerate(cell.at))
            above[-1].children[octant] = cell
            above[-1].weight += cell.weight
        levels.insert(0, above)
    return levels


class Colors:
    def __init__(self, d, step):
        self.d = d
        self.steps = [step * length * 256 for length in (443, 362, 627)]
        self.any, self.zero, self.magnitude = Models(), Models(), Models(MagnitudeModel)
        self.symbols = 0

    def walk(self, levels, coded_levels):
        for number, level in enumerate(levels[:-1]):
            self.coded = number < coded_levels
            places = {cell.at: cell for cell in level}
            for place, cell in enumerate(level):
                cell.place = place
            for place, cell in enumerate(level):
                if len(cell.children) == 1:
                    (child,) = cell.children.values()
                    child.mean, child.above = cell.mean, cell.above
                else:
                    self.split_cell(cell, level, places)

    def split_cell(self, cell, level, places):
        across = lambda axis, by: places.get(tuple(x + by if a == axis else x for a, x in enumerate(cell.at)))
        around = level[cell.place - 1].activity if cell.place > 0 else 0
        around += sum(other.activity for other in (across(a, -1) for a in range(3)) if other)
        self.around = min(5, around.bit_length())
        self.above = min(3, cell.above.bit_length())
        self.symbols = 0
        self.look_around(cell, level, places, around)
        weights, sums, means = [0] * 16, [[0, 0, 0] for _ in range(16)], [None] * 16
        for octant, child in cell.children.items():
            predicted = self.predict(cell, octant, across, places)
            weights[8 + octant], sums[8 + octant] = child.weight, [p * child.weight for p in predicted]
        for g in range(7, 0, -1):
            weights[g] = weights[2 * g] + weights[2 * g + 1]
            sums[g] = [x + y for x, y in zip(sums[2 * g], sums[2 * g + 1])]
        means[1] = cell.mean
        for g in range(1, 8):
            a, b = 2 * g, 2 * g + 1
            v, w = weights[a], weights[b]
            if v == 0 or w == 0:
                means[a] = means[b] = means[g]
            else:
                d = [self.believe(toward_zero(y, w) - toward_zero(x, v)) for x, y in zip(sums[a], sums[b])]
                means[a], means[b] = self.split(means[g], v, w, d, self.coded)
        cell.activity = min(self.symbols, 255)
        for octant, child in cell.children.items():
            child.mean, child.above = means[8 + octant], cell.activity

    def look_around(self, cell, level, places, around):
        pass

    def believe(self, difference):
        return difference

    def predict(self, cell, octant, across, places):
        weight = 4
        total = [weight * m for m in cell.mean]
        for axis in range(3):
            other = across(axis, 1 if octant >> axis & 1 else -1)
            if other is None:
                continue
            touching = other.children.get(octant ^ 1 << axis) if other.place < cell.place else None
            w, mean = (3, touching.mean) if touching else (2, other.mean)
            total, weight = [t + w * m for t, m in zip(total, mean)], weight + w
        reciprocal = (65536 + weight // 2) // weight
        return [t * reciprocal >> 16 for t in total]

    def split(self, mean, v, w, d, coded):
        if coded:
            gain = (v * w // (v + w) << 16) + ((v * w % (v + w) << 16) // (v + w))
            root = math.isqrt(gain)
            steps = [step // root + 1 for step in self.steps]
            for c, q in enumerate(self.read_symbols(clamp(gain.bit_length() - 16, 0, 15), d, steps)):
                d[c] = clamp(d[c] + q * steps[c], -(1 << 24), 1 << 24)
                self.symbols += min(abs(q), 15) * (2 if c == 0 else 1)
        share = (w << 16) // (v + w)
        low = [m - (x * share >> 16) for m, x in zip(mean, d)]
        return low, [m + x for m, x in zip(low, d)]

    def read_symbols(self, gain, d, steps):
        out = [0, 0, 0]
        if not self.d.bit(self.any[gain, self.around, self.above]):
            return out
        before = 0
        for c in range(3):
            known = c == 2 and before == 0
            if not known and self.d.bit(self.zero[c, self.around, before]):
                continue
            negative = self.d.raw(1)
            q = (self.magnitude[c, self.around].decode(self.d) & 0xFFFFFF) + 1
            out[c] = -q if negative else q
            before |= 1 << min(c, 1)
        return out

    def halve(self, begin, end, mean, out):
        if end - begin == 1:
            out[begin] = mean
            return
        middle = begin + (end - begin + 1) // 2
        self.around = self.above = 0
        low, high = self.split(mean, middle - begin, end - middle, [0, 0, 0], True)
        self.halve(begin, middle, low, out)
        self.halve(middle, end, high, out)


# --- 8.6 Coarse colour ----------------------------------------------------------------------------------------------

EDGE_AXES = ((0, 1), (0, 2), (1, 2))


def bits(v, most):
    return min(most, v.bit_length())


class CoarseColors(Colors):
    """Edges count too, doubtful predictions less, and each bit is mixed."""

    def __init__(self, d, step, trust):
        super().__init__(d, step)
        self.trust = trust
        self.inverse = [(1 << 40) // ((s >> 7) + 1) for s in self.steps]
        self.models, self.mixers = Models(), {}

    def mixed(self, name, of, *keys):
        """The bit `name`, by the mixer of `of` and a model for each key."""
        mixer = self.mixers.setdefault((name, of), Mixer(len(keys), 15))
        return mixer.decode(self.d, [self.models[name, n, key] for n, key in enumerate(keys)])

    @staticmethod
    def moved(cell, steps):
        return tuple(x + steps.get(a, 0) for a, x in enumerate(cell.at))

    def look_around(self, cell, level, places, around):
        sides = [places.get(self.moved(cell, {a: by})) for a in range(3) for by in (-1, 1)]
        sides = [s for s in sides if s]
        edges = [places.get(self.moved(cell, {u: i, v: j})) for u, v in EDGE_AXES for i in (-1, 1) for j in (-1, 1)]
        edges = [e for e in edges if e]
        self.beside, self.handed = around, cell.above
        self.diagonal = sum(e.activity for e in edges if e.place < cell.place)
        self.ahead = sum(e.above for e in edges if e.place > cell.place)
        self.ahead += sum(2 * s.above for s in sides if s.place > cell.place)
        self.contrast = [max((abs(s.mean[c] - cell.mean[c]) for s in sides), default=0) for c in range(3)]

    def believe(self, difference):
        return clamp(difference * self.trust >> 4, -(1 << 24), 1 << 24)

    def predict(self, cell, octant, across, places):
        near = [({a: self.side(octant, a)}, 1 << a, 2, 4) for a in range(3)]
        near += [({u: self.side(octant, u), v: self.side(octant, v)}, 1 << u | 1 << v, 1, 2) for u, v in EDGE_AXES]
        total, weight = [0, 0, 0], 8
        for steps, flips, whole, touching in near:
            other = places.get(self.moved(cell, steps))
            if other is None:
                continue
            child = other.children.get(octant ^ flips) if other.place < cell.place else None
            w, mean = (touching, child.mean) if child else (whole, other.mean)
            for c in range(3):
                x = mean[c] - cell.mean[c]
                doubt = min(127, abs(x) * self.inverse[c] >> 36)
                total[c] += w * (x * (65536 // (256 + doubt * doubt)) >> 8)
            weight += w
        reciprocal = (65536 + weight // 2) // weight
        return [m + (t * reciprocal >> 16) for m, t in zip(cell.mean, total)]

    @staticmethod
    def side(octant, axis):
        return 1 if octant >> axis & 1 else -1

    def read_symbols(self, gain, d, steps):
        out = [0, 0, 0]
        expected = [bits(16 * abs(x) // t, 7) for x, t in zip(d, steps)]
        contrast = [bits(16 * x // t, 11) for x, t in zip(self.contrast, steps)]
        here, ahead = bits(self.symbols, 7), bits(self.ahead, 11)
        busy = bits(2 * self.beside + 3 * self.handed + 4 * self.symbols, 11)
        if not self.mixed("any", gain, (gain, expected[0]), (gain, busy, expected[0]), (gain, contrast[0], here),
                          (gain, bits(self.beside, 11), bits(self.handed, 8)),
                          (gain, bits(self.diagonal, 11), ahead)):
            return out
        before = 0
        for c in range(3):
            sizes = [min(3, abs(q)) for q in out[:2]]
            if not (c == 2 and before == 0) and self.mixed(
                    "zero", (c, before), (c, before, self.around), (c, before, contrast[c], expected[c]),
                    (c, before, gain, here), (c, before, *sizes, ahead)):
                continue
            falls = d[c] < 0
            signs = [(q > 0) - (q < 0) for q in out[:2]]
            negative = self.mixed("sign", c, (c, expected[c]), (c, falls, *signs)) != falls
            length = 0
            while length < 24:
                l = min(length, 7)
                if not self.mixed("longer", (c, l), (c, l, busy), (c, l, contrast[c], expected[c]),
                                  (c, l, gain, before)):
                    break
                length += 1
            q = self.mantissa(c, length) + 1
            out[c] = -q if negative else q
            before |= 1 << min(c, 1)
        return out

    def mantissa(self, c, length):
        if length < 2:
            return length
        r = 1
        for _ in range(min(length - 1, 2)):
            r = r * 2 + self.d.bit(self.models["mantissa", c, min(length, 8), r])
        raw = length - 1 - min(length - 1, 2)
        return r << raw | self.d.raw(raw) if raw else r


def read_colors(r, channel, voxels):
    flags, step, coded_levels = r.uint(1), r.varint(), r.uint(1)
    root = [256 * r.signed() for _ in range(3)]
    trust = r.uint(1) if flags & 8 else 0
    if flags > 11 or flags & 4 or flags & 9 == 9 or trust > 64 or step == 0:
        raise Damaged("a broken colour head")
    d = RangeDecoder(r.raw(r.left()))
    colors, levels = CoarseColors(d, step, trust) if flags & 8 else Colors(d, step), build_tree(voxels)
    levels[0][0].mean = root
    colors.walk(levels, coded_levels)
    means = [None] * len(voxels)
    for cell in levels[-1]:
        end = cell.begin + cell.weight
        if flags & 1:
            colors.halve(cell.begin, end, cell.mean, means)
        else:
            means[cell.begin : end] = [cell.mean] * cell.weight
    s = 257 if flags & 2 else 1
    size = SCALAR_SIZE[channel["scalar"]]
    return [b"".join(number.to_bytes(size, "little") for number in rgb_numbers(m, s)) for m in means]


def rgb_numbers(mean, s):
    l, m, q = mean
    return [clamp((six * 10923 * s + (1 << 27)) >> 28, 0, 255 * s)
            for six in (2 * l + 3 * m + q, 2 * (l - q), 2 * l - 3 * m + q)]
