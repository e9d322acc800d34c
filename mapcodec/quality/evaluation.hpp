// SPDX-License-Identifier: GPL-3.0-or-later
// How far a decoded cloud is from its original: the numbers of `mapcodec evaluate`.
#pragma once

#include <cstdint>
#include <limits>

#include "mapcodec/base/result.hpp"
#include "mapcodec/base/runner.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

struct EvaluationSettings {
  bool with_normals = true;  ///< D2 too (the slowest part)
  double voxel_m = 0.10;     ///< voxels of the density error [m]
  int shifts = 4;            ///< grids of the density error
  int knn = 12;              ///< neighbours for the normals, where the original has none
  double peak_m = 0;         ///< peak of the PSNRs [m]; 0: the longest side of the original's box
};

/// NaN where a measure does not apply (no colour on one side, normals not asked for); a PSNR without error is
/// infinite. "ab" is from each original point to its nearest decoded one, "ba" the other way. Non-finite
/// points are left out.
struct Evaluation {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

  std::uint64_t points_original = 0, points_decoded = 0;
  double count_ratio = kNone;                 ///< decoded / original
  double rms_m = kNone;                       ///< the larger of rms_ab_m and rms_ba_m
  double rms_ab_m = kNone, rms_ba_m = kNone;  ///< root mean square distances
  double rms_pool_m = kNone;                  ///< over the points of both directions together
  double max_m = kNone;                       ///< Hausdorff distance
  double max_axis_error_m = kNone;  ///< Hausdorff distance in the maximum norm: largest error along one axis
  double peak_m = kNone;            ///< as used below
  double d1_psnr_db = kNone;        ///< 10 log10(3 peak^2 / larger mean squared distance)
  double d2_psnr_db = kNone;        ///< the same for distances along the normals
  double color_error = kNone;       ///< mean RGB distance of neighbours (0..255), mean of both directions
  double color_error_ab = kNone, color_error_ba = kNone;
  double y_psnr_db = kNone;      ///< BT.709 luma, peak 255, the worse direction
  double density_error = kNone;  ///< quality/density.hpp
};

/// Measures `decoded` against `original`.
/// Errors: Empty (no finite point on a side); InvalidArgument (settings out of range, 2^32 points or more).
/// Threads: those of `runner`; the result is the same for any number.
/// Source: PAPER.md's measures (Morell et al. 2014); D1, D2 as MPEG's common test conditions for point
/// clouds.
[[nodiscard]] Result<Evaluation> evaluate(const PointCloud& original, const PointCloud& decoded,
                                          Runner& runner, const EvaluationSettings& settings = {});

}  // namespace mapcodec
