# SPDX-License-Identifier: GPL-3.0-or-later
"""mapcodec/FORMAT.md, section 4: the entropy coder. Slow and plain; see read_tile.py."""
import math

from read_archive import Damaged

M64 = (1 << 64) - 1


# --- 4.1 Range coder ----------------------------------------------------------------------------------------------

class RangeDecoder:
    def __init__(self, data):
        self.data, self.at, self.range = data, 0, M64
        self.code = self.take(8)

    def take(self, count):
        part = self.data[self.at : self.at + count]
        self.at += count
        if self.at > len(self.data) + 16:
            raise Damaged("a range code ends too early")
        return int.from_bytes(part + bytes(count - len(part)), "big")

    def renormalise(self):
        if self.range < 1 << 32:
            self.range <<= 32
            self.code = self.code << 32 | self.take(4)

    def bit_of(self, p):
        """A bit whose probability of being 1 is p / 65536."""
        bound = (self.range >> 16) * p
        one = self.code < bound
        if one:
            self.range = bound
        else:
            self.code -= bound
            self.range -= bound
        self.renormalise()
        return int(one)

    def bit(self, model):
        b = self.bit_of(model.p())
        model.update(b)
        return b

    def tree(self, models, key, bits):
        """`bits` bits, most significant first, each in the context of those before."""
        node = 1
        for _ in range(bits):
            node = 2 * node + self.bit(models[(*key, node)])
        return node - (1 << bits)

    def raw(self, count):
        v = 0
        while count > 0:
            k = min(count, 16)
            self.range >>= k
            part = self.code // self.range
            if part >> k:
                raise Damaged("impossible raw bits")
            self.code -= part * self.range
            self.renormalise()
            v, count = v << k | part, count - k
        return v


# --- 4.2 Bit model ------------------------------------------------------------------------------------------------

class BitModel:
    def __init__(self):
        self.fast = self.slow = 32768
        self.n = 0

    def p(self):
        return (self.fast + self.slow) >> 1

    def update(self, bit):
        target = 65504 if bit else 32
        step = 655360 // (10 * self.n + 16)
        self.fast += ((target - self.fast) * max(step, 4096)) >> 16
        self.slow += ((target - self.slow) * step) >> 16
        self.n = min(self.n + 1, 126)


class Models(dict):
    """A table of contexts: one made when first used."""

    def __init__(self, kind=BitModel):
        super().__init__()
        self.kind = kind

    def __missing__(self, key):
        self[key] = self.kind()
        return self[key]


# --- 4.3 Integer model --------------------------------------------------------------------------------------------

class IntegerModel:
    def __init__(self):
        self.unary, self.lengths, self.mantissa = Models(), Models(), Models()

    def decode(self, d):
        length = 0
        while length < 12 and d.bit(self.unary[length]):
            length += 1
        if length == 12:
            length += d.tree(self.lengths, (), 6)
        if length < 2:
            return length
        if length > 64:
            return 0
        modelled = min(length - 1, 2)
        v = 1 << modelled | d.tree(self.mantissa, (length,), modelled)
        rest = length - 1 - modelled
        return v << rest | d.raw(rest)


# --- 4.4 Magnitude model ------------------------------------------------------------------------------------------

class MagnitudeModel:
    def __init__(self):
        self.unary, self.mantissa = Models(), Models()

    def decode(self, d):
        length = 0
        while length < 64 and d.bit(self.unary[min(length, 15)]):
            length += 1
        if length < 2:
            return length
        modelled = min(length - 1, 2)
        v = 1 << modelled | d.tree(self.mantissa, (min(length, 16),), modelled)
        rest = length - 1 - modelled
        return v << rest | d.raw(rest)


# --- 4.5 Mixer ----------------------------------------------------------------------------------------------------

def clamp(v, low, high):
    return max(low, min(high, v))


STRETCH = [clamp(round(256 * math.log((i + 0.5) / (4095.5 - i))), -2047, 2047) for i in range(4096)]
SQUASH = [clamp(math.floor(65536 / (1 + math.exp((2048 - i) / 256)) + 0.5), 32, 65504) for i in range(4096)]


class Mixer:
    def __init__(self, inputs=3, rate=16):
        self.weights = [26214] + [19661] * (inputs - 1)
        self.rate, self.half = rate, 1 << (rate - 1)

    def decode(self, d, models):
        logits = [STRETCH[m.p() >> 4] for m in models]
        dot = sum(w * s for w, s in zip(self.weights, logits))
        p = SQUASH[clamp(dot >> 16, -2047, 2047) + 2048]
        bit = d.bit_of(p)
        error = (65535 if bit else 0) - p
        self.weights = [clamp(w + ((s * error + self.half) >> self.rate), -524288, 524288)
                        for w, s in zip(self.weights, logits)]
        for m in models:
            m.update(bit)
        return bit


# --- 4.6 Symbol code ----------------------------------------------------------------------------------------------

class SymbolDecoder:
    def __init__(self, data):
        if len(data) % 2:
            raise Damaged("a symbol code of half words")
        self.words = [data[i] | data[i + 1] << 8 for i in range(0, len(data), 2)]
        self.at = 0
        self.state = self.word() << 16 | self.word()

    def word(self):
        self.at += 1
        if self.at > len(self.words):
            raise Damaged("a symbol code ends too early")
        return self.words[self.at - 1]

    def refill(self):
        if self.state < 1 << 16:
            self.state = self.state << 16 | self.word()

    def part(self, bounds):
        """bounds: where each part starts, and 32768."""
        slot = self.state & 32767
        s = max(i for i, b in enumerate(bounds) if b <= slot)
        self.state = (bounds[s + 1] - bounds[s]) * (self.state >> 15) + slot - bounds[s]
        self.refill()
        return s

    def bit(self, model):
        b = 1 - self.part([0, model.p() >> 1, 32768])
        model.update(b)
        return b

    def raw(self, count):
        v = self.state & (1 << count) - 1
        self.state >>= count
        self.refill()
        return v

    def symbol(self, *models):
        """In one model, or in two."""
        bounds = [(a + b + 1) >> 1 for a, b in zip(models[0].bounds, models[-1].bounds)]
        s = self.part(bounds)
        for m in models:
            m.update(s)
        return s

    def end(self):
        if self.at != len(self.words) or self.state != 1 << 16:
            raise Damaged("a symbol code that ends where it should not")


# --- 4.7 Nibble model ---------------------------------------------------------------------------------------------

class NibbleModel:
    def __init__(self, weights=None):
        self.n = 0
        self.bounds = [2048 * i for i in range(17)]
        if weights:
            weights = weights[:15] + [sum(weights[15:])] if len(weights) > 15 else weights
            self.n, total = 2, sum(weights)
            self.bounds = [i + sum(weights[:i]) * 32752 // total for i in range(16)] + [32768]

    def update(self, s):
        step = min(655360 // (10 * self.n + 16), 32767)
        for i in range(16):
            target = 16 * i if i <= s else 32768 - 16 * (16 - i)
            self.bounds[i] += ((target - self.bounds[i]) * step) >> 16
        self.n = min(self.n + 1, 126)
