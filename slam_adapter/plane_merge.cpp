// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/plane_merge.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mapcodec {
namespace {

using Pair = std::array<std::uint32_t, 2>;

struct Entry {
  std::uint64_t key;
  std::uint32_t patch;
  auto operator<=>(const Entry&) const = default;
};

std::uint64_t hash_cell(std::int64_t x, std::int64_t y, std::int64_t z) {
  auto h = static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15u;
  h = (h ^ (h >> 32)) + static_cast<std::uint64_t>(y) * 0xc2b2ae3d27d4eb4fu;
  h = (h ^ (h >> 29)) + static_cast<std::uint64_t>(z) * 0x165667b19e3779f9u;
  return h ^ (h >> 32);
}

/// Names the patch in all cells that a cube of 2 reach a side around `p` meets.
void enter(const Vec3& p, double reach, double cell, std::uint32_t patch, std::vector<Entry>& entries) {
  std::array<std::int64_t, 3> lo, hi;
  for (std::size_t d = 0; d < 3; ++d) {
    lo[d] = static_cast<std::int64_t>(std::floor((p[d] - reach) / cell));
    hi[d] = static_cast<std::int64_t>(std::floor((p[d] + reach) / cell));
  }
  for (std::int64_t x = lo[0]; x <= hi[0]; ++x) {
    for (std::int64_t y = lo[1]; y <= hi[1]; ++y) {
      for (std::int64_t z = lo[2]; z <= hi[2]; ++z) entries.push_back({hash_cell(x, y, z), patch});
    }
  }
}

constexpr double kMostSamples = 4096;  // along an edge: a cell may be far larger than the gaps

/// Where a patch's outline passes.
std::vector<Entry> entries_of(const SurfacePatch& patch, std::uint32_t index, double gap) {
  std::vector<Entry> entries;
  const std::size_t n = patch.polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& a = patch.polygon[i];
    const Vec3 d = minus(patch.polygon[(i + 1) % n], a);
    const double steps = std::clamp(std::ceil(std::sqrt(dot(d, d)) / gap), 1.0, kMostSamples);
    for (double s = 0; s < steps; ++s) {
      const double t = s / steps;
      enter({a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]}, gap / 2, 2 * gap, index, entries);
    }
  }
  std::sort(entries.begin(), entries.end());
  entries.erase(std::unique(entries.begin(), entries.end()), entries.end());
  return entries;
}

/// Planes under construction: a forest over the patches, sums at its roots.
class Joiner {
 public:
  Joiner(std::span<const SurfacePatch> patches, const PlaneMergeSettings& settings) : settings_(settings) {
    parent_.resize(patches.size());
    std::iota(parent_.begin(), parent_.end(), 0u);
    for (const SurfacePatch& p : patches) {
      moments_.emplace_back(p);
      normals_.push_back(p.normal);
      extents_.push_back(std::sqrt(p.area_m2) / 2);
    }
  }

  std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  [[nodiscard]] const PlaneMoments& moments(std::uint32_t root) const { return moments_[root]; }

  /// How badly two patches fit each other; above 1: not at all.
  [[nodiscard]] double misfit(std::uint32_t a, std::uint32_t b) const {
    const Vec3 d = minus(moments_[a].mean, moments_[b].mean);
    const double off =
        std::max(std::abs(dot(d, normals_[a])) / (2 * settings_.tolerance_m + 0.2 * extents_[a]),
                 std::abs(dot(d, normals_[b])) / (2 * settings_.tolerance_m + 0.2 * extents_[b]));
    const double angle = angle_between(normals_[a], normals_[b]);
    return std::max(off, angle / (leeway(a) + leeway(b)));
  }

  bool join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    if (a == b) return false;
    PlaneMoments both = moments_[a];
    both.add(moments_[b]);
    const FittedPlane plane = fit_plane(both);
    if (!belongs(a, both, plane) || !belongs(b, both, plane)) return false;
    const std::uint32_t keep = std::min(a, b);
    parent_[std::max(a, b)] = keep;
    moments_[keep] = both;
    normals_[keep] = plane.normal;
    extents_[keep] = plane.least_extent;
    return true;
  }

 private:
  static double angle_between(const Vec3& a, const Vec3& b) {
    return std::acos(std::min(1.0, std::abs(dot(a, b))));
  }
  /// A patch that is small against the tolerance may lean as it likes.
  [[nodiscard]] double leeway(std::uint32_t i) const {
    return std::max(settings_.angle_rad, std::atan2(settings_.tolerance_m, extents_[i]));
  }
  [[nodiscard]] bool belongs(std::uint32_t i, const PlaneMoments& both, const FittedPlane& plane) const {
    const double off = dot(minus(moments_[i].mean, both.mean), plane.normal);
    const double squared = moments_[i].spread_along(plane.normal) + off * off;
    return squared <= settings_.tolerance_m * settings_.tolerance_m &&
           angle_between(normals_[i], plane.normal) <= leeway(i);
  }

  PlaneMergeSettings settings_;
  std::vector<std::uint32_t> parent_;
  std::vector<PlaneMoments> moments_;
  std::vector<Vec3> normals_;
  std::vector<double> extents_;
};

struct Candidate {
  double misfit;
  Pair pair;
  auto operator<=>(const Candidate&) const = default;
};

void join_all(Joiner& joiner, const std::vector<Pair>& pairs) {
  std::vector<Candidate> candidates;
  for (const Pair& p : pairs) {
    const double misfit = joiner.misfit(p[0], p[1]);
    if (misfit <= 1) candidates.push_back({misfit, p});
  }
  std::sort(candidates.begin(), candidates.end());
  // What two small patches do not agree on yet, their planes may.
  constexpr int kPasses = 4;
  for (int pass = 0; pass < kPasses && !candidates.empty(); ++pass) {
    bool any = false;
    for (const Candidate& c : candidates) any |= joiner.join(c.pair[0], c.pair[1]);
    std::erase_if(candidates,
                  [&](const Candidate& c) { return joiner.root(c.pair[0]) == joiner.root(c.pair[1]); });
    if (!any) break;
  }
}

Vec3 upright(Vec3 n) {
  const auto longer = [](double a, double b) { return std::abs(a) < std::abs(b); };
  if (*std::max_element(n.begin(), n.end(), longer) < 0) {
    for (double& x : n) x = -x;
  }
  return n;
}

MapPlane plane_of(std::span<const SurfacePatch> patches, std::vector<std::uint32_t> mine,
                  const PlaneMoments& moments) {
  const FittedPlane fit = fit_plane(moments);
  MapPlane plane;
  plane.normal = upright(fit.normal);
  plane.center = moments.mean;
  plane.offset_m = dot(plane.normal, plane.center);
  plane.rms_m = std::sqrt(fit.squared + moments.noise / moments.weight);
  double colored = 0;
  for (const std::uint32_t i : mine) {
    const SurfacePatch& p = patches[i];
    plane.points += p.points;
    plane.area_m2 += p.area_m2;
    if (!p.colored) continue;
    colored += double(p.points);
    for (std::size_t c = 0; c < 3; ++c) plane.rgb[c] += double(p.points) * p.rgb[c];
  }
  plane.colored = colored > 0;
  for (double& c : plane.rgb) c /= plane.colored ? colored : 1;
  plane.patches = std::move(mine);
  return plane;
}

}  // namespace

std::vector<Pair> patch_neighbors(std::span<const SurfacePatch> patches, double gap_m) {
  std::vector<Entry> entries;
  for (std::uint32_t i = 0; i < patches.size(); ++i) {
    const std::vector<Entry> some = entries_of(patches[i], i, gap_m);
    entries.insert(entries.end(), some.begin(), some.end());
  }
  std::sort(entries.begin(), entries.end());
  std::vector<Pair> pairs;
  for (std::size_t begin = 0, end = 0; begin < entries.size(); begin = end) {
    while (end < entries.size() && entries[end].key == entries[begin].key) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = i + 1; j < end; ++j) pairs.push_back({entries[i].patch, entries[j].patch});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

std::vector<MapPlane> merge_patches(std::span<const SurfacePatch> patches,
                                    const PlaneMergeSettings& settings) {
  Joiner joiner(patches, settings);
  join_all(joiner, patch_neighbors(patches, settings.tolerance_m));
  std::vector<std::vector<std::uint32_t>> sets(patches.size());
  for (std::uint32_t i = 0; i < patches.size(); ++i) sets[joiner.root(i)].push_back(i);
  std::vector<MapPlane> planes;
  for (std::uint32_t r = 0; r < sets.size(); ++r) {
    if (sets[r].empty() || joiner.moments(r).weight < double(settings.least_points)) continue;
    planes.push_back(plane_of(patches, std::move(sets[r]), joiner.moments(r)));
  }
  std::stable_sort(planes.begin(), planes.end(),
                   [](const MapPlane& a, const MapPlane& b) { return a.points > b.points; });
  for (MapPlane& p : planes)
    p.outlines = outline_patches(patches, p.patches, p.center, p.normal, settings.tolerance_m);
  return planes;
}

}  // namespace mapcodec
