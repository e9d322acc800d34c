// SPDX-License-Identifier: GPL-3.0-or-later
// Points drawn uniformly inside triangles [Morell et al. 2014, Algorithm 2].
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Shares `total` among `weights` so that the shares add up to `total` exactly and each is less than one away
/// from its proportion: differences of the rounded running sum. (Largest-remainder rounding holds the total
/// too, but starves all small triangles of a region alike; the running sum gives every k-th of them a point.)
/// All weights 0: shared equally. Empty `weights`: empty.
/// @param total  below 2^32.
[[nodiscard]] std::vector<std::uint32_t> apportion(std::span<const std::uint64_t> weights,
                                                   std::uint64_t total);

/// SplitMix64 [Steele, Lea, Flood 2014]: integers only, the same numbers on every machine.
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

 private:
  std::uint64_t state_;
};

/// Fills `out` with points drawn uniformly inside the triangle a, b, c.
/// @param as_f32  round the coordinates to float32 numbers, as a file of floats would.
void sample_triangle(const Vec3& a, const Vec3& b, const Vec3& c, SplitMix& random, bool as_f32,
                     std::span<Vec3> out);

/// [m^2]
[[nodiscard]] double triangle_area(const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace mapcodec
