// SPDX-License-Identifier: GPL-3.0-or-later
// Number lattices that real files hold: decimals of a text file, binary fractions, millimetres times 0.001f
// (FORMAT.md 8.1).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

namespace mapcodec {

/// x = the value of integer k, in the precision of the source. The ids are written to archives.
enum class LatticeKind : std::uint8_t {
  decimal = 1,  ///< k / 10^n
  binary = 2,   ///< k / 2^n
  product = 3,  ///< float32(k) * float32(10^-n), multiplied in float32
  fixed = 4,    ///< k * scale + offset (LAS)
  uniform = 5,  ///< k * scale, for values kept within a bound
};

/// A lattice and the one rounding it ends with. All arithmetic is single IEEE operations, each rounded to
/// nearest, so every machine gives the same numbers.
struct ValueLattice {
  LatticeKind kind = LatticeKind::decimal;
  std::uint8_t n = 0;   ///< decimal 0..9, binary 0..30, product 1..6
  bool single = false;  ///< round the result to float32
  double scale = 1;     ///< fixed, uniform
  double offset = 0;    ///< fixed

  static constexpr std::int64_t kMost = std::int64_t{1} << 52;  ///< |k| stays below it

  [[nodiscard]] static double power_of_ten(std::uint8_t n) {
    constexpr std::array<double, 10> kPowers{1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
    return kPowers[n < 10 ? n : 9];
  }
  [[nodiscard]] static float small_unit(std::uint8_t n) {
    constexpr std::array<float, 7> kUnits{1.0f, 0.1f, 0.01f, 0.001f, 0.0001f, 0.00001f, 0.000001f};
    return kUnits[n < 7 ? n : 6];
  }

  /// Distance of neighbouring values, nearly.
  [[nodiscard]] double unit() const {
    switch (kind) {
      case LatticeKind::decimal:
        return 1 / power_of_ten(n);
      case LatticeKind::binary:
        return std::ldexp(1.0, -int{n});
      case LatticeKind::product:
        return double{small_unit(n)};
      default:
        return scale;
    }
  }

  [[nodiscard]] double value(std::int64_t k) const {
    const double v = wide_value(k);
    return single ? static_cast<double>(static_cast<float>(v)) : v;
  }

  /// The k nearest to `x`, which may be off by rounding; nullopt if out of range or not finite.
  [[nodiscard]] std::optional<std::int64_t> nearest(double x) const {
    const double k = std::nearbyint(kind == LatticeKind::fixed ? (x - offset) / scale : scaled(x));
    if (!(std::abs(k) < static_cast<double>(kMost))) return std::nullopt;
    return static_cast<std::int64_t>(k);
  }
  /// The k whose value is `x` in every bit (-0 is none).
  [[nodiscard]] std::optional<std::int64_t> exactly(double x) const {
    const auto k = nearest(x);
    if (!k || value(*k) != x || (x == 0 && std::signbit(x) != std::signbit(value(*k)))) return std::nullopt;
    return k;
  }

 private:
  [[nodiscard]] double scaled(double x) const {
    switch (kind) {
      case LatticeKind::decimal:
        return x * power_of_ten(n);
      case LatticeKind::binary:
        return std::ldexp(x, n);
      default:
        return x / unit();
    }
  }
  [[nodiscard]] double wide_value(std::int64_t k) const {
    switch (kind) {
      case LatticeKind::decimal:
        return static_cast<double>(k) / power_of_ten(n);
      case LatticeKind::binary:
        return std::ldexp(static_cast<double>(k), -int{n});
      case LatticeKind::product:
        return static_cast<double>(static_cast<float>(k) * small_unit(n));
      case LatticeKind::uniform:
        return static_cast<double>(k) * scale;
      case LatticeKind::fixed:
        break;
    }
    // Two roundings: a compiler must not fuse them, here or in the program that wrote the file.
    volatile const double product = static_cast<double>(k) * scale;
    return product + offset;
  }
};

}  // namespace mapcodec
