// SPDX-License-Identifier: GPL-3.0-or-later
// From a promise or a wanted size to the plan that all tiles are coded with.
#pragma once

#include <atomic>
#include <optional>

#include "slam_adapter/compress.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace mapcodec {

/// How one tile departs from the plan.
struct TileChoice {
  CodecId codec = CodecId::points;
  double step_share = 1;  ///< of the plan's step
};

struct PlanChoice {
  CodingPlan plan;
  double rms_slope = 1;   ///< d log RMS / d log step near the plan's step
  double bits_slope = 1;  ///< - d log bits / d log step
  double spacing_m = 0;   ///< of the sample; 0 where it was not looked at
  double side_m = 0;      ///< longest side of a piece of the sample
  /// The whole map's positions, coded by this plan, where the search came across them.
  std::optional<CodedTiles> coded;
  /// Where each tile has a codec and a step of its own: these, in the order of the tiles; else empty.
  std::vector<TileChoice> tiles;
};

/// What the options ask of codecs: surfaces are for an RMS promise, and always keep counts.
[[nodiscard]] CodecChoice allowed_codecs(const CompressOptions& options);

/// Decides codecs and step. `schema` comes from choose_schema; its step and, where points are resampled, its
/// channels are changed, which `warnings` then says. Errors: those of encoding; InvalidArgument (a size that
/// cannot be reached); Cancelled.
[[nodiscard]] Result<PlanChoice> choose_plan(const CompressOptions& options, const TileSet& tiles,
                                             MapSchema& schema, Arena& arena,
                                             std::vector<std::string>& warnings);

/// A size was asked for, not an error.
[[nodiscard]] bool has_target(const CompressOptions& options);
/// The colour channel that is kept within a bound: an index into `schema.channels`.
[[nodiscard]] std::optional<std::size_t> bounded_color(const MapSchema& schema);

/// Bits per point that the promise refers to.
[[nodiscard]] double target_bits(const CompressOptions& options, const MapSchema& schema);

/// "12.3 mm".
[[nodiscard]] std::string millimetres(double m);

}  // namespace mapcodec
