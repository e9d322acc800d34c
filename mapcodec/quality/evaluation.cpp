// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/evaluation.hpp"

#include <optional>

#include "mapcodec/quality/color_difference.hpp"
#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/finite_points.hpp"
#include "mapcodec/quality/nearest.hpp"
#include "mapcodec/quality/plane_error.hpp"

namespace mapcodec {
namespace {

double psnr(double peak_squared, double mean_squared) {
  return mean_squared > 0 ? 10 * std::log10(peak_squared / mean_squared)
                          : std::numeric_limits<double>::infinity();
}

Status check(const PointCloud& original, const PointCloud& decoded, const EvaluationSettings& s) {
  if (original.empty())
    return make_error(ErrorCode::kEmpty, "the original has no point with a finite position");
  if (decoded.empty())
    return make_error(ErrorCode::kEmpty, "the decoded cloud has no point with a finite position");
  if (std::max(original.size(), decoded.size()) > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::kInvalidArgument, "more than 2^32 points cannot be compared at once");
  }
  if (!(s.voxel_m > 0) || s.shifts < 1 || s.knn < 1 || !(s.peak_m >= 0)) {
    return make_error(ErrorCode::kInvalidArgument, "evaluation settings must be positive");
  }
  return {};
}

double longest_side(const Box& b) {
  return std::max({b.max[0] - b.min[0], b.max[1] - b.min[1], b.max[2] - b.min[2]});
}

void fill_distances(const DistanceStats& ab, const DistanceStats& ba, Evaluation& e) {
  const auto na = static_cast<double>(e.points_original), nb = static_cast<double>(e.points_decoded);
  e.count_ratio = nb / na;
  e.rms_ab_m = std::sqrt(ab.mean_squared);
  e.rms_ba_m = std::sqrt(ba.mean_squared);
  e.rms_m = std::max(e.rms_ab_m, e.rms_ba_m);
  e.rms_pool_m = std::sqrt((ab.mean_squared * na + ba.mean_squared * nb) / (na + nb));
  e.max_m = std::max(ab.max_m, ba.max_m);
  e.d1_psnr_db = psnr(3 * e.peak_m * e.peak_m, std::max(ab.mean_squared, ba.mean_squared));
}

void fill_colors(const NeighborPair& pair, Evaluation& e) {
  const std::optional<Colors> original = Colors::of(pair.original), decoded = Colors::of(pair.decoded);
  if (!original || !decoded) return;
  const ColorStats ab = color_difference(*original, *decoded, pair.to_decoded);
  const ColorStats ba = color_difference(*decoded, *original, pair.to_original);
  e.color_error_ab = ab.mean_distance;
  e.color_error_ba = ba.mean_distance;
  e.color_error = (ab.mean_distance + ba.mean_distance) / 2;
  e.y_psnr_db = psnr(255.0 * 255.0, std::max(ab.luma_mse, ba.luma_mse));
}

double parallel_density_error(const PointCloud& original, const PointCloud& decoded,
                              const EvaluationSettings& s, Runner& runner) {
  std::vector<double> differences(static_cast<std::size_t>(s.shifts));
  runner.run(differences.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      differences[i] = density_difference(original.xyz, decoded.xyz, s.voxel_m,
                                          s.voxel_m * static_cast<double>(i) / s.shifts);
    }
  });
  double sum = 0;
  for (const double d : differences) sum += d / static_cast<double>(original.size()) / s.shifts;
  return sum;
}

/// Both k-d trees, built side by side.
struct Indices {
  std::optional<NeighborIndex> original, decoded;

  Indices(const PointCloud& a, const PointCloud& b, Runner& runner) {
    runner.run(2, [&](std::size_t begin, std::size_t end) {
      if (begin == 0) original.emplace(a.xyz);
      if (end == 2) decoded.emplace(b.xyz);
    });
  }
};

}  // namespace

Result<Evaluation> evaluate(const PointCloud& original, const PointCloud& decoded, Runner& runner,
                            const EvaluationSettings& settings) {
  const FinitePoints a(original), b(decoded);
  MAPCODEC_TRY(check(*a, *b, settings));
  const Indices indices(*a, *b, runner);
  const Nearest to_decoded = find_nearest(a->xyz, *indices.decoded, runner);
  const Nearest to_original = find_nearest(b->xyz, *indices.original, runner);
  const NeighborPair pair{*a, *b, *indices.original, to_decoded, to_original};

  Evaluation e;
  e.points_original = a->size();
  e.points_decoded = b->size();
  e.peak_m = settings.peak_m > 0 ? settings.peak_m : longest_side(a->bounds());
  fill_distances(summarise(a->xyz, to_decoded), summarise(b->xyz, to_original), e);
  e.max_axis_error_m = std::max(max_axis_error(a->xyz, b->xyz, *indices.decoded, to_decoded),
                                max_axis_error(b->xyz, a->xyz, *indices.original, to_original));
  fill_colors(pair, e);
  if (settings.with_normals) {
    e.d2_psnr_db = psnr(3 * e.peak_m * e.peak_m, plane_mean_squared_error(pair, settings.knn, runner));
  }
  e.density_error = parallel_density_error(*a, *b, settings, runner);
  return e;
}

}  // namespace mapcodec
