// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/triangle_sampler.hpp"

#include <bit>

namespace mapcodec {
namespace {

// Brings the sum below 2^31, so that sum * total fits 64 bits.
int weight_shift(std::span<const std::uint64_t> weights) {
  std::uint64_t largest = 0;
  for (const std::uint64_t w : weights) largest = std::max(largest, w);
  const int room = 31 - static_cast<int>(std::bit_width(weights.size()));
  return std::max(0, static_cast<int>(std::bit_width(largest)) - std::max(1, room));
}

}  // namespace

std::vector<std::uint32_t> apportion(std::span<const std::uint64_t> weights, std::uint64_t total) {
  std::vector<std::uint32_t> shares(weights.size());
  const int shift = weight_shift(weights);
  std::uint64_t sum = 0;
  for (const std::uint64_t w : weights) sum += w >> shift;
  const bool equal = sum == 0;
  if (equal) sum = weights.size();
  std::uint64_t running = 0;
  std::uint64_t given = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    running += equal ? 1 : weights[i] >> shift;
    const std::uint64_t due = (running * total + sum / 2) / sum;
    shares[i] = static_cast<std::uint32_t>(due - given);
    given = due;
  }
  return shares;
}

void sample_triangle(const Vec3& a, const Vec3& b, const Vec3& c, SplitMix& random, bool as_f32,
                     std::span<Vec3> out) {
  constexpr double kUnit = 1.0 / 4294967296.0;
  const Vec3 ab{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Vec3 ac{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  for (Vec3& p : out) {
    const std::uint64_t bits = random.next();
    auto r = static_cast<std::uint32_t>(bits);
    auto s = static_cast<std::uint32_t>(bits >> 32);
    // The far half of the parallelogram is folded back onto the triangle.
    const std::uint32_t fold = (std::uint64_t{r} + s) >> 32 != 0 ? ~std::uint32_t{0} : 0;
    r ^= fold;
    s ^= fold;
    const double x = (r + 0.5) * kUnit;
    const double y = (s + 0.5) * kUnit;
    for (std::size_t d = 0; d < 3; ++d) p[d] = a[d] + (x * ab[d] + y * ac[d]);
    if (!as_f32) continue;
    for (std::size_t d = 0; d < 3; ++d) p[d] = static_cast<double>(static_cast<float>(p[d]));
  }
}

double triangle_area(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 p{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Vec3 q{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const double x = p[1] * q[2] - p[2] * q[1];
  const double y = p[2] * q[0] - p[0] * q[2];
  const double z = p[0] * q[1] - p[1] * q[0];
  return 0.5 * std::sqrt(x * x + y * y + z * z);
}

}  // namespace mapcodec
