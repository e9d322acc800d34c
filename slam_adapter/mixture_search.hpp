// SPDX-License-Identifier: GPL-3.0-or-later
// Codings of several tiles that keep one rms together: each is tried at a few steps, by surfaces and by
// points, and one Lagrangian over all says which coding of its own each tile takes.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "mapcodec/codec/tile_codec.hpp"
#include "slam_adapter/mixture_choice.hpp"

namespace mapcodec {

/// A coding of a tile's positions and what it was made with.
struct TileTry {
  TileSettings settings;
  EncodedTile coded;
  double seconds = 0;  ///< processor time
};
/// Codes the positions of the tiles with these numbers by the same settings; nothing where a tile cannot be
/// coded so. Errors: Cancelled.
using CodeTiles = std::function<Result<std::vector<std::optional<TileTry>>>(
    std::span<const std::size_t> tiles, const TileSettings& settings)>;

class MixtureSearch {
 public:
  /// All must outlive the search. @param rms_m  of all points together, in both directions.
  /// @param most_rms_m  of one tile.
  MixtureSearch(std::size_t tiles, double rms_m, const CodeTiles& code, double most_rms_m = INFINITY)
      : rms_m_(rms_m), most_rms_m_(most_rms_m), code_(code), tried_(tiles), sizes_(tiles), figures_(tiles) {}

  /// @param surfaces  their trade, effort and the step to begin with. @param with_points  tiles may be coded
  /// as points too. @return one coding for each tile; nothing if no mixture of those tried keeps the rms.
  /// Errors: those of `code`.
  [[nodiscard]] Result<std::optional<std::vector<TileTry>>> run(TileSettings surfaces, bool with_points);

 private:
  [[nodiscard]] Status try_all(std::span<const std::size_t> tiles, const TileSettings& settings);
  [[nodiscard]] Status try_points(double step_m);
  [[nodiscard]] Status try_points_alone();
  [[nodiscard]] bool is_complete() const;
  [[nodiscard]] Status try_finer(TileSettings surfaces);
  void drop_hopeless(double bit_price);
  [[nodiscard]] double rms_of(std::span<const std::size_t> choice) const;
  [[nodiscard]] std::optional<std::vector<std::size_t>> best() const;

  [[nodiscard]] std::vector<Codings> within_tile_rms(std::vector<Codings> tiles) const;

  double rms_m_, most_rms_m_;
  const CodeTiles& code_;
  TileSettings points_;
  std::vector<std::vector<TileTry>> tried_;  // for each tile
  std::vector<Codings> sizes_, figures_;     // of those; the latter with what density is worth
  std::vector<std::size_t> surfaces_;        // tiles for which more surfaces are tried
};

/// The search of MixtureSearch (whose parameters these are), and again where one direction of the error is
/// left far below the other: with surfaces that weigh the worse one more. The smaller of the two.
[[nodiscard]] Result<std::optional<std::vector<TileTry>>> search_mixture(std::size_t tiles, double rms_m,
                                                                         const CodeTiles& code,
                                                                         const TileSettings& surfaces,
                                                                         bool with_points,
                                                                         double most_rms_m = INFINITY);

/// What a mixture takes [bits], with what its density is worth where that rms is allowed.
[[nodiscard]] double cost_of(std::span<const TileTry> tiles, double rms_m);

}  // namespace mapcodec
