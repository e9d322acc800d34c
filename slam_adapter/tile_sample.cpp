// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/tile_sample.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "mapcodec/quality/nearest.hpp"
#include "parallel/encode_pipeline.hpp"
#include "parallel/runner.hpp"
#include "parallel/tile_neighbors.hpp"

namespace mapcodec {
namespace {

struct Size {
  std::size_t pieces, points;
};
constexpr std::size_t kSamplePoints = 300000;
constexpr Size kUsual{16, kSamplePoints}, kLarge{4, 400000};
constexpr std::size_t kSpacingQueries = 4000;

double longest_side(const Box& b, std::size_t& axis) {
  axis = 0;
  for (std::size_t d = 1; d < 3; ++d) {
    if (b.max[d] - b.min[d] > b.max[axis] - b.min[axis]) axis = d;
  }
  return b.empty() ? 0 : b.max[axis] - b.min[axis];
}

/// Halves the cloud across its longer side until few enough points are left: the upper half, then the lower,
/// so that parts are not all from one corner.
PointCloud cut(const PointCloud& cloud, std::size_t most) {
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  for (bool upper = true; order.size() > most; upper = !upper) {
    Box b;
    for (const std::uint32_t i : order) b.add(cloud.xyz[i]);
    std::size_t axis = 0;
    longest_side(b, axis);
    const auto less = [&](std::uint32_t i, std::uint32_t j) {
      return cloud.xyz[i][axis] != cloud.xyz[j][axis] ? cloud.xyz[i][axis] < cloud.xyz[j][axis] : i < j;
    };
    const auto middle = order.begin() + static_cast<std::ptrdiff_t>(order.size() / 2);
    std::nth_element(order.begin(), middle, order.end(), less);
    upper ? order.erase(order.begin(), middle) : order.erase(middle, order.end());
  }
  std::sort(order.begin(), order.end());
  return cloud.gather(order);
}

struct Pick {
  std::size_t tile;
  std::size_t points;  ///< at most
};

/// Tiles at even distances of points, so that each region counts as much as it does in the map.
std::vector<Pick> picked(const TileSet& tiles, const Size& size, bool whole) {
  std::vector<Pick> picks;
  std::uint64_t before = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < tiles.tiles().size(); ++i) {
    const std::uint64_t end = before + tiles.tiles()[i].points;
    std::size_t times = 0;
    while (next < size.pieces && (2 * next + 1) * tiles.points() / (2 * size.pieces) < end) ++next, ++times;
    before = end;
    if (whole) {
      picks.push_back({i, size.points});
    } else if (times > 0) {
      picks.push_back({i, times * size.points / size.pieces});
    }
  }
  return picks;
}

void measure(TileSample& sample, Arena& arena) {
  std::vector<double> spacings(sample.pieces.size());
  TbbRunner(arena).run(spacings.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) spacings[i] = mean_spacing(sample.pieces[i].xyz);
  });
  double weighted = 0;
  for (std::size_t i = 0; i < spacings.size(); ++i) {
    std::size_t axis = 0;
    sample.side_m = std::max(sample.side_m, longest_side(sample.pieces[i].bounds(), axis));
    weighted += spacings[i] * static_cast<double>(sample.pieces[i].size());
  }
  if (sample.points() > 0) sample.spacing_m = weighted / static_cast<double>(sample.points());
}

Result<TileSample> take(const Size& size, const TileSet& tiles, const MapSchema& schema, Arena& arena) {
  TileSample sample;
  sample.whole = tiles.points() <= kSamplePoints;
  const TileNeighbors neighbors(tiles, schema.origin, schema.tile_size_m);
  for (const auto& [tile, points] : picked(tiles, size, sample.whole)) {
    MAPCODEC_ASSIGN(const PointCloud cloud, tiles.load(tile));
    sample.pieces.push_back(cut(cloud, points));
    if (sample.whole) sample.borders.push_back(neighbors.borders_of(tiles.tiles()[tile].key));
  }
  measure(sample, arena);
  return sample;
}

}  // namespace

std::size_t TileSample::points() const {
  std::size_t sum = 0;
  for (const PointCloud& piece : pieces) sum += piece.size();
  return sum;
}

TileSample TileSample::part(std::size_t most) const {
  const std::size_t all = points();
  if (all <= most) return *this;
  TileSample r{{}, {}, false, side_m, spacing_m};
  // No piece falls below a few thousand points: too small a tile says nothing about a large one.
  constexpr std::size_t kLeastPiece = 4000;
  for (const PointCloud& piece : pieces)
    r.pieces.push_back(cut(piece, std::max(kLeastPiece, piece.size() * most / all)));
  return r;
}

TileSample TileSample::some(std::size_t most) const {
  const std::size_t all = points();
  if (all <= most) return *this;
  TileSample r{{}, {}, false, side_m, spacing_m};
  for (std::size_t i = 0, before = 0; i < pieces.size(); ++i) {
    // Each piece in whose middle the next of evenly spread points lies.
    const std::size_t middle = before + pieces[i].size() / 2;
    before += pieces[i].size();
    if (r.points() >= middle * most / all) continue;
    r.pieces.push_back(pieces[i]);
    if (i < borders.size()) r.borders.push_back(borders[i]);
  }
  return r;
}

double mean_spacing(std::vector<Vec3> points) {
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 2) return 0;
  const NeighborIndex index(points);
  const std::size_t take = std::min(points.size(), kSpacingQueries);
  double sum = 0;
  for (std::size_t i = 0; i < take; ++i) {
    std::array<std::uint32_t, 2> ids{};
    std::array<double, 2> squared{};
    index.nearest(points[i * points.size() / take], ids, squared);
    sum += std::sqrt(squared[1]);
  }
  return sum / static_cast<double>(take);
}

Result<TileSample> take_sample(const TileSet& tiles, const MapSchema& schema, Arena& arena) {
  return take(kUsual, tiles, schema, arena);
}

Result<TileSample> take_large_sample(const TileSet& tiles, const MapSchema& schema, Arena& arena) {
  return take(kLarge, tiles, schema, arena);
}

Result<CodedSum> encode_sample(const TileSample& sample, const MapSchema& schema, const CodingPlan& plan,
                               Arena& arena, const std::atomic<bool>* stop, CodedTiles* tiles) {
  if (stop != nullptr && stop->load()) return make_error(ErrorCode::kCancelled, "interrupted");
  std::vector<std::optional<Result<EncodedTile>>> coded(sample.pieces.size());
  std::vector<double> seconds(coded.size());
  TbbRunner(arena).run(coded.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double since = thread_seconds();
      CodingPlan own = plan;
      if (i < sample.borders.size()) own.tiles.borders = sample.borders[i];
      coded[i] = encode_by_plan(sample.pieces[i], schema, own);
      seconds[i] = thread_seconds() - since;
    }
  });
  CodedSum sum;
  for (const auto& tile : coded) {
    if (!tile->ok()) return tile->error();
    sum.add(**tile);
  }
  if (tiles != nullptr) {
    tiles->tiles.clear();
    for (auto& tile : coded) tiles->tiles.push_back(std::move(**tile));
    tiles->seconds = std::move(seconds);
  }
  return sum;
}

Result<std::vector<std::optional<TileTry>>> encode_pieces(const TileSample& sample,
                                                          std::span<const std::size_t> pieces,
                                                          const MapSchema& schema,
                                                          const TileSettings& settings, Arena& arena,
                                                          const std::atomic<bool>* stop) {
  if (stop != nullptr && stop->load()) return make_error(ErrorCode::kCancelled, "interrupted");
  std::vector<std::optional<TileTry>> tries(pieces.size());
  TbbRunner(arena).run(pieces.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double since = thread_seconds();
      TileSettings own = settings;
      if (pieces[i] < sample.borders.size()) own.borders = sample.borders[pieces[i]];
      auto coded = encode_tile(sample.pieces[pieces[i]], schema, own);
      if (coded.ok()) tries[i] = TileTry{own, std::move(coded).value(), thread_seconds() - since};
    }
  });
  return tries;
}

}  // namespace mapcodec
