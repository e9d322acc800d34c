// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/kmeans.hpp"

#include <algorithm>
#include <limits>

#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec {
namespace {

using Color = std::array<std::uint16_t, 3>;
using Center = std::array<double, 3>;
constexpr std::size_t kLearntColors = 20000;
constexpr int kRounds = 25;

double squared_distance(const Color& a, const Center& b) {
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

std::uint32_t nearest(const Color& color, const std::vector<Center>& centers) {
  std::uint32_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < centers.size(); ++i) {
    const double d = squared_distance(color, centers[i]);
    if (d < least) {
      least = d;
      best = i;
    }
  }
  return best;
}

std::vector<Color> take_evenly(std::span<const Color> colors) {
  const std::size_t count = std::min(colors.size(), kLearntColors);
  std::vector<Color> r;
  r.reserve(count);
  for (std::size_t i = 0; i < count; ++i) r.push_back(colors[i * colors.size() / count]);
  return r;
}

/// Each next centre is a colour drawn with the probability of its squared distance to the centres so far.
std::vector<Center> choose_centers(const std::vector<Color>& colors, std::uint32_t clusters) {
  SplitMix random(clusters);
  std::vector<Center> centers;
  std::vector<double> distance(colors.size(), std::numeric_limits<double>::infinity());
  std::size_t chosen = random.next() % colors.size();
  while (true) {
    centers.push_back({double(colors[chosen][0]), double(colors[chosen][1]), double(colors[chosen][2])});
    if (centers.size() == clusters) return centers;
    double sum = 0;
    for (std::size_t i = 0; i < colors.size(); ++i) {
      distance[i] = std::min(distance[i], squared_distance(colors[i], centers.back()));
      sum += distance[i];
    }
    if (!(sum > 0)) return centers;  // fewer different colours than clusters
    double until = static_cast<double>(random.next() >> 11) * 0x1p-53 * sum;
    for (chosen = 0; chosen + 1 < colors.size() && until >= distance[chosen]; ++chosen)
      until -= distance[chosen];
  }
}

/// @return whether a centre moved.
bool improve(const std::vector<Color>& colors, std::vector<Center>& centers) {
  std::vector<Center> sums(centers.size(), Center{});
  std::vector<double> counts(centers.size());
  for (const Color& color : colors) {
    const std::uint32_t n = nearest(color, centers);
    for (std::size_t c = 0; c < 3; ++c) sums[n][c] += color[c];
    ++counts[n];
  }
  bool moved = false;
  for (std::size_t i = 0; i < centers.size(); ++i) {
    if (counts[i] == 0) continue;
    const Center mean{sums[i][0] / counts[i], sums[i][1] / counts[i], sums[i][2] / counts[i]};
    moved = moved || mean != centers[i];
    centers[i] = mean;
  }
  return moved;
}

}  // namespace

std::vector<std::uint32_t> cluster_colors(std::span<const Color> colors, std::uint32_t clusters) {
  std::vector<std::uint32_t> r(colors.size());
  if (clusters < 2 || colors.empty()) return r;
  const std::vector<Color> learnt = take_evenly(colors);
  std::vector<Center> centers = choose_centers(learnt, clusters);
  for (int i = 0; i < kRounds && improve(learnt, centers); ++i) {
  }
  for (std::size_t i = 0; i < colors.size(); ++i) r[i] = nearest(colors[i], centers);
  return r;
}

}  // namespace mapcodec
