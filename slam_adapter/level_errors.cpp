// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/level_errors.hpp"

#include <algorithm>
#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/quality/nearest.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kMostTiles = 16;
constexpr std::uint64_t kMostPoints = 400000;  // of all chosen tiles; but one tile in any case
constexpr std::uint64_t kFewPoints = 10000;    // of a map too small for levels to matter
constexpr std::size_t kQueries = 2000;
constexpr double kFinest = 1e-5;  // [m]

/// Twelfths of an octave above a hundredth of a millimetre, rounded up: 0 .. 25 m in a byte.
std::uint8_t code_of(double rms_m) {
  if (!(rms_m > kFinest)) return 0;
  return static_cast<std::uint8_t>(std::min(255.0, std::ceil(12 * std::log2(rms_m / kFinest) - 1e-9)));
}

std::vector<Vec3> thinned(const std::vector<Vec3>& points, std::size_t most) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / most);
  std::vector<Vec3> r;
  for (std::size_t i = 0; i < points.size(); i += step) r.push_back(points[i]);
  return r;
}

double mean_squared(const std::vector<Vec3>& from, const NeighborIndex& to) {
  double sum = 0;
  for (const Vec3& p : from) {
    double squared = 0;
    (void)to.nearest(p, squared);
    sum += squared;
  }
  return sum / static_cast<double>(from.size());
}

/// One tile at all its levels.
struct TileLevels {
  std::uint64_t points = 0;
  std::vector<double> forward, backward;  // mean squared distances; the last level's are the tile's own
  std::vector<std::uint64_t> bytes;
};

/// Points to measure distances to: all, and a part of them, which tells as much of distances far above the
/// points' spacing, and sooner.
class Target {
 public:
  Target(const std::vector<Vec3>& points, double spacing2)
      : points_(points), part_(thinned(points, kPart)), few_(part_) {
    near2_ = 25 * spacing2 * static_cast<double>(points.size()) / static_cast<double>(part_.size());
  }
  /// @param all  an index of all points, where there is one already.
  [[nodiscard]] double mean_squared_from(const std::vector<Vec3>& queries,
                                         const NeighborIndex* all = nullptr) const {
    const double squared = mean_squared(queries, few_);
    if (squared > near2_ || part_.size() == points_.size()) return squared;
    return all != nullptr ? mean_squared(queries, *all) : mean_squared(queries, NeighborIndex(points_));
  }

 private:
  static constexpr std::size_t kPart = 30000;
  const std::vector<Vec3>& points_;
  std::vector<Vec3> part_;
  NeighborIndex few_;
  double near2_;
};

/// Mean squared distance of a point to the next, of points that lie on surfaces; by a sample.
double squared_spacing(const std::vector<Vec3>& queries, const NeighborIndex& index) {
  double sum = 0;
  for (const Vec3& p : queries) {
    std::array<std::uint32_t, 2> ids{};
    std::array<double, 2> squared{};
    if (index.nearest(p, ids, squared) == 2) sum += squared[1];
  }
  return sum / static_cast<double>(queries.size());
}

bool is_placed(const std::vector<Vec3>& points) {
  return !points.empty() && std::all_of(points.begin(), points.end(), is_finite);
}

Result<TileLevels> sizes_of(const Bytes& bytes, const MapSchema& schema) {
  TileLevels tile;
  MAPCODEC_ASSIGN(const unsigned levels, count_tile_levels(bytes, schema));
  MAPCODEC_ASSIGN(tile.bytes, tile_level_bytes(bytes, schema));
  tile.bytes.resize(levels, tile.bytes.back());
  tile.bytes.back() = bytes.size();
  return tile;
}

/// All levels but the last, which is known.
Status measure_tile(const std::vector<Vec3>& original, const Bytes& bytes, const MapSchema& schema,
                    Runner& runner, TileLevels& tile) {
  const std::size_t levels = tile.bytes.size();
  const NeighborIndex index(original);
  const std::vector<Vec3> queries = thinned(original, kQueries);
  const double spacing2 = squared_spacing(queries, index);
  const Target whole(original, spacing2);
  std::vector<Status> status(levels);
  runner.run(levels - 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t l = begin; l < end; ++l) {
      const auto decoded = decode_tile_coarsely(bytes, schema, static_cast<unsigned>(l));
      if (!decoded.ok()) {
        status[l] = decoded.error();
        continue;
      }
      tile.forward[l] = Target(decoded->xyz, spacing2).mean_squared_from(queries);
      tile.backward[l] = whole.mean_squared_from(thinned(decoded->xyz, kQueries), &index);
    }
  });
  for (const Status& s : status) MAPCODEC_TRY(s);
  return {};
}

/// The tiles together, each by its points; one with fewer levels is at its last in all further ones.
LevelErrors pool(const std::vector<TileLevels>& tiles) {
  LevelErrors r;
  r.tiles = tiles.size();
  std::size_t levels = 0;
  double all_bytes = 0;
  for (const TileLevels& t : tiles) {
    levels = std::max(levels, t.bytes.size());
    all_bytes += static_cast<double>(t.bytes.back());
    r.points += t.points;
  }
  for (std::size_t l = 0; l < levels; ++l) {
    double forth = 0, back = 0, bytes = 0;
    for (const TileLevels& t : tiles) {
      const std::size_t at = std::min(l, t.bytes.size() - 1);
      forth += static_cast<double>(t.points) * t.forward[at];
      back += static_cast<double>(t.points) * t.backward[at];
      bytes += static_cast<double>(t.bytes[at]);
    }
    r.levels.push_back({std::sqrt(std::max(forth, back) / static_cast<double>(r.points)), bytes / all_bytes});
  }
  return r;
}

}  // namespace

Bytes write_level_errors(const LevelErrors& errors) {
  ByteWriter out;
  out.varint(errors.tiles);
  out.varint(errors.points);
  for (const LevelErrors::Level& l : errors.levels) {
    out.u8(code_of(l.rms_m));
    out.u8(static_cast<std::uint8_t>(std::clamp(std::ceil(255 * l.byte_share), 0.0, 255.0)));
  }
  return out.take();
}

Result<LevelErrors> read_level_errors(ByteSpan bytes) {
  ByteReader in(bytes);
  LevelErrors e;
  e.tiles = in.varint();
  e.points = in.varint();
  MAPCODEC_TRY(in.status("levels"));
  if (in.left() % 2 != 0 || in.left() > 2 * (kMostTileLevel + 1))
    return make_error(ErrorCode::kMalformed, "levels of an unknown form");
  while (in.left() > 0) {
    const double rms = kFinest * std::exp2(in.u8() / 12.0);
    e.levels.push_back({rms, in.u8() / 255.0});
  }
  return e;
}

LevelSampler::LevelSampler(const TileSet& tiles) : tiles_(tiles) {
  const std::size_t n = tiles.tiles().size();
  if (tiles.points() < kFewPoints) return;
  std::uint64_t points = 0;
  const std::size_t most = std::min(n, kMostTiles);
  for (std::size_t k = 0; k < most; ++k) {
    const std::size_t i = (2 * k + 1) * n / (2 * most);
    const TileSet::Entry& tile = tiles.tiles()[i];
    if (tile.key.is_unplaced() || (points > 0 && points + tile.points > kMostPoints)) continue;
    points += tile.points;
    chosen_.emplace(tile.key, i);
  }
}

void LevelSampler::keep(const TileKey& key, const EncodedTile& tile) {
  const auto chosen = chosen_.find(key);
  const bool has_levels = tile.codec == CodecId::surface || tile.codec == CodecId::points;
  if (chosen == chosen_.end() || !has_levels) return;
  kept_[chosen->second] = {tile.bytes, tile.rms_forward_m, tile.rms_backward_m};
}

Result<LevelErrors> LevelSampler::measure(const MapSchema& schema, Runner& runner) const {
  std::vector<TileLevels> tiles;
  for (const auto& [i, kept] : kept_) {
    MAPCODEC_ASSIGN(const PointCloud original, tiles_.load(i));
    if (!is_placed(original.xyz)) continue;
    MAPCODEC_ASSIGN(TileLevels tile, sizes_of(kept.bytes, schema));
    tile.points = original.size();
    tile.forward.assign(tile.bytes.size(), kept.forward_m * kept.forward_m);
    tile.backward.assign(tile.bytes.size(), kept.backward_m * kept.backward_m);
    MAPCODEC_TRY(measure_tile(original.xyz, kept.bytes, schema, runner, tile));
    tiles.push_back(std::move(tile));
  }
  return pool(tiles);
}

}  // namespace mapcodec
