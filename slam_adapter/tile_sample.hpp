// SPDX-License-Identifier: GPL-3.0-or-later
// A part of the map that stands for the whole, to try settings on.
#pragma once

#include <atomic>
#include <vector>

#include "parallel/tile_set.hpp"
#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/mixture_search.hpp"

namespace mapcodec {

struct TileSample {
  std::vector<PointCloud> pieces;    ///< compact parts of tiles, every point of the part
  std::vector<TileBorders> borders;  ///< of the pieces, where they are whole tiles; else empty
  bool whole = false;                ///< pieces are all tiles of the map, uncut
  double side_m = 0;                 ///< longest side of a piece
  double spacing_m = 0;              ///< mean distance to the nearest other position

  [[nodiscard]] std::size_t points() const;
  /// Compact parts of the pieces, `points` together or a little more.
  [[nodiscard]] TileSample part(std::size_t points) const;
  /// Some of the pieces, uncut and evenly spread: `points` together, about, but one piece at least.
  [[nodiscard]] TileSample some(std::size_t points) const;
};

/// The whole map if it is small; else sixteen tiles at most, evenly spread, and of large ones a compact part,
/// so that trying is cheap. The same for any number of threads. Errors: those of TileSet::load.
/// @param schema  of the map: says where tiles lie.
[[nodiscard]] Result<TileSample> take_sample(const TileSet& tiles, const MapSchema& schema, Arena& arena);
/// Fewer and larger parts, for what depends on how much a tile holds; the whole map if it is small.
[[nodiscard]] Result<TileSample> take_large_sample(const TileSet& tiles, const MapSchema& schema,
                                                   Arena& arena);

/// A sample as coded.
struct CodedTiles {
  std::vector<EncodedTile> tiles;
  std::vector<double> seconds;  ///< processor time of each
};

/// Encodes the pieces in parallel. Errors: those of encoding; Cancelled.
/// @param tiles  out: what became of each piece, if wanted.
[[nodiscard]] Result<CodedSum> encode_sample(const TileSample& sample, const MapSchema& schema,
                                             const CodingPlan& plan, Arena& arena,
                                             const std::atomic<bool>* stop, CodedTiles* tiles = nullptr);

/// Encodes these pieces by one codec, in parallel; nothing where a piece cannot be coded so. Errors:
/// Cancelled.
[[nodiscard]] Result<std::vector<std::optional<TileTry>>> encode_pieces(
    const TileSample& sample, std::span<const std::size_t> pieces, const MapSchema& schema,
    const TileSettings& settings, Arena& arena, const std::atomic<bool>* stop);

/// Mean distance [m] of some thousand finite points, evenly spread, to the nearest other position.
[[nodiscard]] double mean_spacing(std::vector<Vec3> points);

}  // namespace mapcodec
