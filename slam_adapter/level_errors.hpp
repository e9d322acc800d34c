// SPDX-License-Identifier: GPL-3.0-or-later
// What a map is like at each level of detail, measured when it is made and kept in its archive.
#pragma once

#include <map>
#include <vector>

#include "mapcodec/base/runner.hpp"
#include "mapcodec/codec/tile_levels.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

/// Key in MapInfo::extras.
inline constexpr const char* kLevelsExtra = "lod";

struct LevelErrors {
  std::uint64_t tiles = 0;   ///< that were measured, of the map's
  std::uint64_t points = 0;  ///< of these tiles
  struct Level {
    double rms_m = 0;       ///< symmetric: the larger direction; rounded up by at most 6 %
    double byte_share = 1;  ///< of the tiles' bytes, which are needed for this level
  };
  std::vector<Level> levels;  ///< 0 the coarsest; the last one is the map as it is
};

/// maps/FORMAT.md 4.1.
[[nodiscard]] Bytes write_level_errors(const LevelErrors& errors);
/// @param bytes  may be hostile. Errors: Truncated, Malformed.
[[nodiscard]] Result<LevelErrors> read_level_errors(ByteSpan bytes);

/// Keeps the bytes of a few tiles while a map is written, and measures them against their points: at most
/// sixteen tiles spread evenly over the map, and but one where they are large; in each direction about 2,000
/// points of a tile, against all of the other side.
class LevelSampler {
 public:
  explicit LevelSampler(const TileSet& tiles);

  /// Forgets what it kept: the map is written again.
  void clear() { kept_.clear(); }
  /// To be told each tile that is written.
  void keep(const TileKey& key, const EncodedTile& tile);
  /// Errors: those of TileSet::load and decode_tile.
  [[nodiscard]] Result<LevelErrors> measure(const MapSchema& schema, Runner& runner) const;

 private:
  struct Kept {
    Bytes bytes;
    double forward_m = 0, backward_m = 0;
  };
  const TileSet& tiles_;
  std::map<TileKey, std::size_t, MortonLess> chosen_;  // to the index in the set
  std::map<std::size_t, Kept> kept_;
};

}  // namespace mapcodec
