// SPDX-License-Identifier: GPL-3.0-or-later
// How the tiles of a map are coded, and what they lost together.
#pragma once

#include <cmath>

#include "mapcodec/codec/tile_codec.hpp"

namespace mapcodec {

/// Which codecs a map with an RMS promise may use for a tile.
enum class CodecChoice : std::uint8_t { cheapest, surface, points };

/// What all tiles are coded with. Under `cheapest` one Lagrangian decides for each tile: its mean squared
/// error of both directions plus what a bit has to save, of positions alone.
struct CodingPlan {
  CodecChoice choice = CodecChoice::points;
  TileSettings tiles;  ///< what is neither step nor choice; tiles.codec is used by `points`
  double step_m = 0;   ///< surface step, or voxel side where the choice is `points`; 0: the codec has none
  std::optional<CodecId> fixed;  ///< the choice is made: surface or points, with the steps of a mixture
  double voxel_steps = 2.7;  ///< voxel side of `points` tiles among surfaces, in surface steps (of price 1)

  /// Side of voxels among surfaces, per surface step.
  [[nodiscard]] double voxels_per_step() const { return voxel_steps * std::sqrt(tiles.trade.bit_price); }
  /// The step of the plan at which a tile is coded with these settings, in steps of this plan.
  [[nodiscard]] double share_of(const TileSettings& s) const {
    return s.step_m / step_m / (s.codec == CodecId::surface ? 1 : voxels_per_step());
  }
  [[nodiscard]] bool has_surfaces() const { return choice != CodecChoice::points; }
};

/// Encodes a tile by the plan, by the cheapest codec where there is a choice. Pure, as encode_tile. A tile
/// too wide for surfaces at this step is coded as points. Errors: those of encode_tile.
/// @param memo  of this tile, as for encode_tile.
[[nodiscard]] Result<EncodedTile> encode_by_plan(const PointCloud& tile, const MapSchema& schema,
                                                 const CodingPlan& plan, TileMemo* memo = nullptr);

/// Whole-map figures from those of the tiles: sums weighted by points, so that no tile has to be looked at
/// again.
class CodedSum {
 public:
  void add(const EncodedTile& t);
  /// The larger direction over all points: what an RMS promise is about.
  [[nodiscard]] double rms_m() const {
    return points_ == 0 ? 0 : std::sqrt(std::max(forward_, backward_) / points_);
  }
  /// The original points' RMS distance over that of the decoded ones.
  [[nodiscard]] double forward_to_backward() const { return std::sqrt(forward_ / backward_); }
  [[nodiscard]] TileErrors errors() const;
  /// Colour error that the positions allow at least, about.
  [[nodiscard]] double least_color_error() const { return points_ == 0 ? 0 : least_color_ / points_; }
  [[nodiscard]] double points() const { return points_; }
  [[nodiscard]] double bits_per_point() const { return 8 * bytes_ / points_; }
  [[nodiscard]] double geometry_bits_per_point() const { return 8 * geometry_bytes_ / points_; }
  /// Share of the points that lie in `surface` tiles.
  [[nodiscard]] double surface_share() const { return points_ == 0 ? 0 : surface_points_ / points_; }

 private:
  double points_ = 0, forward_ = 0, backward_ = 0, color_ = 0, least_color_ = 0, density_ = 0, max_axis_ = 0,
         bytes_ = 0;
  double geometry_bytes_ = 0, surface_points_ = 0;
};

/// What a density error counts when codings are compared [bits per point]. Surfaces of few large cells are
/// small, but lose where the points were. @param bits_per_point  of the coding. @param rms_m  that is
/// allowed: what comes of that alone is free.
[[nodiscard]] double worth_of_density(double bits_per_point, double density_error, double rms_m);

/// `schema` with all channels dropped: for positions alone.
[[nodiscard]] MapSchema positions_alone(MapSchema schema);

}  // namespace mapcodec
