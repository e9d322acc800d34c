// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/tile_errors.hpp"

#include "mapcodec/quality/evaluation.hpp"
#include "mapcodec/quality/finite_points.hpp"

namespace mapcodec {
namespace {

TileErrors errors_of_empty(bool both) {
  if (both) return {};
  const double infinite = std::numeric_limits<double>::infinity();
  return {infinite, infinite, 0, infinite};
}

}  // namespace

TileErrors measure_tile(const PointCloud& original, const PointCloud& decoded) {
  const FinitePoints a(original), b(decoded);
  if (a->empty() || b->empty()) return errors_of_empty(a->empty() && b->empty());
  EvaluationSettings settings;
  settings.with_normals = false;
  SerialRunner serial;
  const Result<Evaluation> e = evaluate(*a, *b, serial, settings);
  // Only a tile of 2^32 points can fail here, and no encoder takes one: claim nothing for it.
  if (!e.ok()) return errors_of_empty(false);
  return {e->rms_m, e->max_axis_error_m, std::isnan(e->color_error) ? 0 : e->color_error, e->density_error};
}

}  // namespace mapcodec
