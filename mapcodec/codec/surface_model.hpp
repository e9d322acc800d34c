// SPDX-License-Identifier: GPL-3.0-or-later
// The symbols of a surface tree and their contexts, written once for both sides (FORMAT.md 10.3).
#pragma once

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "mapcodec/codec/surface_polygon.hpp"
#include "mapcodec/codec/surface_prior.hpp"
#include "mapcodec/entropy/bit_model.hpp"

namespace mapcodec::surface {

/// Any integer over adaptive bits: bit length in unary, the bit below the leading one, the rest raw.
class MagnitudeModel {
 public:
  template <class Side>
  std::uint32_t code(Side& side, std::uint32_t v) {
    const int length = std::bit_width(v);
    int l = 0;
    for (; l < kLongest; ++l) {
      if (!side.bit(length > l, unary_[static_cast<std::size_t>(l)])) break;
    }
    if (l < 2) return static_cast<std::uint32_t>(l);
    std::uint32_t r = 1;
    r = r * 2 + side.bit(((v >> (l - 2)) & 1) != 0, below_[static_cast<std::size_t>(l)]);
    if (l > 2) r = (r << (l - 2)) | static_cast<std::uint32_t>(side.raw(v & ((1u << (l - 2)) - 1), l - 2));
    return r;
  }
  template <class Visitor>
  void visit(Visitor&& f) {
    for (std::size_t i = 0; i < 8; ++i) f(unary_[i]);
  }

 private:
  static constexpr int kLongest = 24;
  std::array<BitModel, kLongest> unary_{};
  std::array<BitModel, kLongest + 1> below_{};
};

/// What is known of a cell before its symbols, as small numbers.
struct CellContext {
  int size = 0;       ///< 0..47: binary levels left to a cell of one unit
  int crowd = 0;      ///< 0..6: class of the number of points; 7: in a block, where points are not counted
  int neighbors = 0;  ///< 0..3: no decoded one, leaves only, both, divided only
  int below = 0;      ///< 0..3: evidence of neighbours for points in the lower half
  int above = 0;      ///< 0..3: the same for the upper half
};

inline constexpr int kUncounted = 7;
[[nodiscard]] constexpr int crowd_of(std::uint32_t n) {
  if (n < 3) return n == 2 ? 1 : 0;
  return n < 6 ? 2 : n < 12 ? 3 : n < 32 ? 4 : n < 128 ? 5 : 6;
}
[[nodiscard]] constexpr int size_of(const CellShape& shape) {
  return std::min(47, shape[0] + shape[1] + shape[2]);
}
/// Class of the lower half's share (-1: unknown).
[[nodiscard]] constexpr int share_class(int share) {
  if (share < 0) return 0;
  if (share == 0) return 1;
  if (share == 256) return 7;
  return share < 32 ? 2 : share < 96 ? 3 : share <= 160 ? 4 : share <= 224 ? 5 : 6;
}

inline constexpr std::uint16_t kPriorExperience = 16;  ///< bits that a prior counts for
class Models {
 public:
  /// All contexts as they are at the start of a tile.
  Models();

  /// Whether a cell gets a plane of its own. @param inherits  it has one already.
  template <class Side>
  bool own_plane(Side& side, bool v, const CellContext& c, bool inherits) {
    return side.bit(v, own_[index(c.size, 48, inherits, 2, c.crowd, 7)]);
  }
  /// @param plane  0 none, 1 inherited, 2 own.
  template <class Side>
  bool divided(Side& side, bool v, const CellContext& c, int plane) {
    return side.bit(
        v, divided_[index(c.size, 48, plane, 3, c.crowd, 7) * 4 + static_cast<std::size_t>(c.neighbors)]);
  }
  template <class Side>
  bool wedge(Side& side, bool v, const CellContext& c) {
    return side.bit(v, wedge_[index(c.size, 48, 0, 1, c.crowd, 7)]);
  }
  /// Whether a cell that is not divided is a block of voxels. @param plane  0 none, 1 inherited, 2 own.
  template <class Side>
  bool block(Side& side, bool v, const CellContext& c, int plane) {
    return side.bit(v, block_[index(c.size, 48, plane, 3, 0, 1)]);
  }
  /// How thick a leaf is (0..kMostNoise). @param voxels  it is a block of them.
  template <class Side>
  std::uint8_t noise(Side& side, std::uint8_t v, const CellContext& c, bool voxels) {
    const std::size_t at = index(c.size / 3, 16, voxels, 2, 0, 1) * 5;
    if (!side.bit(v != 0, noise_[at])) return 0;
    return static_cast<std::uint8_t>(1 + tree(side, v - 1u, 2, &noise_[at]));
  }
  template <class Side>
  Wedge wedge_line(Side& side, Wedge w) {
    return {static_cast<std::uint8_t>(tree(side, w.angle, 4, angle_.data())),
            static_cast<std::uint8_t>(tree(side, w.offset, 5, offset_.data()))};
  }
  /// A plane's parameters as differences to `expected`, if there is one.
  template <class Side>
  Plane plane(Side& side, const Plane& v, const Plane* expected, const CellShape& shape,
              const CellContext& c);

  /// 0 both halves hold points, 1 only the lower, 2 only the upper one.
  template <class Side>
  int halves(Side& side, int v, std::uint32_t n, const CellContext& c, int share) {
    const std::size_t at = index(share_class(share), 8, c.below, 4, c.above, 4);
    const std::size_t fine = static_cast<std::size_t>(c.size < 9 ? 0 : c.size < 18 ? 1 : 2);
    if (n > 1 && side.bit(v == 0, both_[(at * 8 + static_cast<std::size_t>(c.crowd)) * 3 + fine])) return 0;
    return side.bit(v == 2, side_[(at * 3 + (c.crowd == kUncounted ? 2u
                                             : n > 1               ? 1u
                                                                   : 0u)) *
                                      3 +
                                  fine])
               ? 2
               : 1;
  }
  /// How many of n >= 2 points lie in the lower half, when both hold some.
  template <class Side>
  std::uint32_t lower_count(Side& side, std::uint32_t v, std::uint32_t n, int share);

  /// The count nearest to `wanted` in [least, most] that the steps can say (if any lies in there).
  [[nodiscard]] std::uint32_t sayable_count(std::uint32_t wanted, std::uint32_t least, std::uint32_t most,
                                            std::uint32_t n, int share) const;

  int voxel_bits = 0;    ///< log2 of the voxels' side in blocks [units]; 0: no blocks
  int count_shift = 31;  ///< counts above 8 are coded to n >> count_shift
  Outline outline;       ///< where cells can hold surface

  template <class Visitor>
  void visit(Visitor&& f);

 private:
  static std::size_t index(int a, int, int b, int nb, int c, int nc) {
    return static_cast<std::size_t>((a * nb + b) * nc + c);
  }
  template <class Side>
  static std::uint32_t tree(Side& side, std::uint32_t v, int bits, BitModel* nodes) {
    std::uint32_t node = 1;
    for (int i = bits - 1; i >= 0; --i) node = node * 2 + side.bit(((v >> i) & 1) != 0, nodes[node]);
    return node - (1u << bits);
  }
  template <class Side>
  std::int32_t signed_value(Side& side, std::int32_t v, MagnitudeModel& m, BitModel& sign) {
    const std::uint32_t size = m.code(side, static_cast<std::uint32_t>(std::abs(v)));
    if (size == 0) return 0;
    return side.bit(v < 0, sign) ? -static_cast<std::int32_t>(size) : static_cast<std::int32_t>(size);
  }

  std::array<BitModel, 48 * 2 * 7> own_{};
  std::array<BitModel, 48 * 3 * 7 * 4> divided_{};
  std::array<BitModel, 48 * 7> wedge_{};
  std::array<BitModel, 48 * 3> block_{};
  std::array<BitModel, 16 * 2 * 5>
      noise_{};  ///< per context: any, then a tree of two bits from its second on
  std::array<BitModel, 16> angle_{};
  std::array<BitModel, 32> offset_{};
  std::array<BitModel, 8 * 16 * 8 * 3> both_{};
  std::array<BitModel, 8 * 16 * 3 * 3> side_{};
  std::array<BitModel, 6 * 8 * 8> few_{};                 // n = 3..8
  std::array<std::array<MagnitudeModel, 3>, 14> many_{};  // by bit width of n and the share's certainty
  std::array<BitModel, 14 * 3> many_sign_{};
  std::array<BitModel, 2> same_axis_{};
  std::array<BitModel, 8> axis_{};
  std::array<std::array<MagnitudeModel, 2>, 16 * 2> plane_{};  // by size and whether expected; height, rises
  BitModel plane_sign_{};
};

template <class Side>
Plane Models::plane(Side& side, const Plane& v, const Plane* expected, const CellShape& shape,
                    const CellContext& c) {
  Plane r;
  if (expected != nullptr && side.bit(v.axis == expected->axis, same_axis_[0])) {
    r.axis = expected->axis;
  } else if (expected != nullptr) {
    r.axis = static_cast<std::uint8_t>(
        (expected->axis + 1u + side.bit(v.axis == (expected->axis + 2u) % 3, same_axis_[1])) % 3);
  } else {
    r.axis = static_cast<std::uint8_t>(std::min(2u, tree(side, v.axis, 2, axis_.data())));
  }
  Plane base;
  bool known = expected != nullptr;
  if (known) {
    base = *expected;
    known = turn_to(base, r.axis, shape);
  }
  if (!known) base = {0, 0, 0, r.axis};
  auto& models = plane_[static_cast<std::size_t>(c.size / 3 * 2 + known)];
  constexpr std::int32_t kRound = 1 << (kPlaneStepBits - 1);
  const auto field = [&](std::int32_t value, std::int32_t guess, MagnitudeModel& m) {
    const std::int32_t steps = (guess + kRound) >> kPlaneStepBits;
    const std::int32_t off = signed_value(side, (value >> kPlaneStepBits) - steps, m, plane_sign_);
    return clamp_height((std::int64_t{steps} + off) * (1 << kPlaneStepBits));
  };
  r.h = field(v.h, base.h, models[0]);
  r.a = field(v.a, base.a, models[1]);
  r.b = field(v.b, base.b, models[1]);
  return r;
}

/// How counts above eight are coded: as a number of steps from what the areas say.
struct CountSteps {
  std::int64_t expected, step, last;
  CountSteps(std::uint32_t n, int share, int shift)
      : expected(std::clamp<std::int64_t>((std::int64_t{n} * (share < 0 ? 128 : share) + 128) >> 8, 1,
                                          std::int64_t{n} - 1)),
        step(std::max(1u, n >> shift)),
        last(std::int64_t{n} - 1) {}
  [[nodiscard]] std::int32_t steps_to(std::int64_t v) const {
    const std::int64_t off = v - expected;
    return static_cast<std::int32_t>((off + (off < 0 ? -step / 2 : step / 2)) / step);
  }
  [[nodiscard]] std::uint32_t count_at(std::int64_t steps) const {
    return static_cast<std::uint32_t>(std::clamp<std::int64_t>(expected + steps * step, 1, last));
  }
};

template <class Side>
std::uint32_t Models::lower_count(Side& side, std::uint32_t v, std::uint32_t n, int share) {
  if (n == 2) return 1;
  if (n <= 8) {
    const std::size_t at = (n - 3) * 8u + static_cast<std::size_t>(share_class(share));
    return std::min(n - 1, 1 + tree(side, v - 1, 3, &few_[at * 8]));
  }
  const CountSteps steps(n, share, count_shift);
  const std::size_t width = static_cast<std::size_t>(std::min(17, static_cast<int>(std::bit_width(n)))) - 4;
  const std::size_t sure = share < 0 ? 0 : (share < 96 || share > 160 ? 1 : 2);
  return steps.count_at(
      signed_value(side, steps.steps_to(v), many_[width][sure], many_sign_[width * 3 + sure]));
}

namespace prior {
/// 65536 / (1 + 2^((31.5 - k) / 4)), rounded.
inline constexpr std::array<std::uint16_t, 64> kProbability = [] {
  constexpr double kRoots[4] = {1, 1.189207115002721, 1.4142135623730951, 1.681792830507429};
  std::array<std::uint16_t, 64> t{};
  for (int k = 0; k < 64; ++k) {
    const int eighths = 63 - 2 * k;                 // of a doubling
    const int quarters = (eighths + 128) / 2 - 64;  // rounded down; the other half eighth is 2^(1/8)
    double odds = 1.0905077326652577 * kRoots[(quarters + 64) % 4];
    for (int i = 0; i < (quarters + 64) / 4 - 16; ++i) odds *= 2;
    for (int i = 0; i < 16 - (quarters + 64) / 4; ++i) odds /= 2;
    t[static_cast<std::size_t>(k)] = static_cast<std::uint16_t>(65536.0 / (1 + odds) + 0.5);
  }
  return t;
}();
[[nodiscard]] constexpr int index_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'Z') return c - 'A' + 10;
  if (c >= 'a' && c <= 'z') return c - 'a' + 36;
  return c == '+' ? 62 : c == '-' ? 63 : -1;
}
}  // namespace prior

inline Models::Models() {
  std::size_t i = 0;
  visit([&](BitModel& m) {
    const int k = i < kPrior.size() ? prior::index_of(kPrior[i]) : -1;
    ++i;
    if (k >= 0) m = BitModel(prior::kProbability[static_cast<std::size_t>(k)], kPriorExperience);
  });
}

inline std::uint32_t Models::sayable_count(std::uint32_t wanted, std::uint32_t least, std::uint32_t most,
                                           std::uint32_t n, int share) const {
  if (n <= 8) return std::clamp(wanted, least, most);
  const CountSteps steps(n, share, count_shift);
  const std::int64_t k = steps.steps_to(wanted);
  std::uint32_t v = steps.count_at(k);
  if (v < least) v = steps.count_at(k + 1);
  if (v > most) v = steps.count_at(k - 1);
  return v;
}

template <class Visitor>
void Models::visit(Visitor&& f) {
  const auto all = [&](auto& models) {
    for (BitModel& m : models) f(m);
  };
  all(own_);
  all(divided_);
  all(wedge_);
  all(block_);
  all(noise_);
  all(angle_);
  all(offset_);
  all(both_);
  all(side_);
  all(few_);
  for (auto& row : many_) {
    for (MagnitudeModel& m : row) m.visit(f);
  }
  all(many_sign_);
  all(same_axis_);
  all(axis_);
  for (auto& row : plane_) {
    for (MagnitudeModel& m : row) m.visit(f);
  }
  f(plane_sign_);
}

}  // namespace mapcodec::surface
