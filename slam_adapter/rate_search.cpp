// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rate_search.hpp"

#include <functional>

#include "mapcodec/codec/points_encoder.hpp"
#include "mapcodec/codec/tile_color.hpp"
#include "parallel/runner.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kSampleTiles = 4;
constexpr double kFinest = 1.0 / (1 << 20);  // of a tile's side
constexpr double kCoarsest = 0.5;

Result<std::vector<PointCloud>> sample_tiles(const TileSet& tiles) {
  std::vector<PointCloud> sample;
  const std::size_t count = tiles.tiles().size();
  const std::size_t take = std::min(count, kSampleTiles);
  for (std::size_t i = 0; i < take; ++i) {
    MAPCODEC_ASSIGN(PointCloud cloud, tiles.load(i * count / take));
    sample.push_back(std::move(cloud));
  }
  return sample;
}

/// Mean over the sample's points of what `measure` gives for a tile (per point), measured in parallel.
Result<double> mean_over(const std::vector<PointCloud>& sample, Arena& arena,
                         const std::function<Result<double>(const PointCloud&)>& measure) {
  std::vector<std::optional<Error>> errors(sample.size());
  std::vector<double> values(sample.size());
  TbbRunner(arena).run(sample.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto value = measure(sample[i]);
      if (value.ok()) {
        values[i] = *value;
      } else {
        errors[i] = value.error();
      }
    }
  });
  double total = 0, points = 0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    if (errors[i]) return *errors[i];
    total += values[i] * double(sample[i].size());
    points += double(sample[i].size());
  }
  return total / points;
}

Result<double> bits_at(double step_m, const std::vector<PointCloud>& sample, MapSchema schema,
                       const TileSettings& settings, Arena& arena) {
  schema.step_m = step_m;
  return mean_over(sample, arena, [&](const PointCloud& cloud) -> Result<double> {
    MAPCODEC_ASSIGN(const EncodedTile tile, encode_tile(cloud, schema, settings));
    return 8.0 * double(tile.bytes.size()) / double(cloud.size());
  });
}

Result<double> color_floor_at(double step_m, std::size_t channel, const std::vector<PointCloud>& sample,
                              const MapSchema& schema, Arena& arena) {
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  return mean_over(sample, arena, [&](const PointCloud& cloud) -> Result<double> {
    MAPCODEC_ASSIGN(const PointsEncoding e, encode_points(cloud.xyz, lattice, {Effort::fast, true}));
    Channel values{cloud.channels[channel].info, {}};
    values.data.resize(e.order.size() * values.info.stride());
    for (std::size_t i = 0; i < e.order.size(); ++i) {
      std::memcpy(values.at(i), cloud.channels[channel].at(e.order[i]), values.info.stride());
    }
    return least_color_error(values, {cloud.xyz, e.order, e.voxels, e.decoded});
  });
}

}  // namespace

Result<double> find_step_for_bits(double bits_per_point, const TileSet& tiles, const MapSchema& schema,
                                  const TileSettings& settings, Arena& arena, const std::atomic<bool>* stop) {
  MAPCODEC_ASSIGN(const std::vector<PointCloud> sample, sample_tiles(tiles));
  double side = 0;
  for (const PointCloud& cloud : sample) {
    const Box b = cloud.bounds();
    for (std::size_t d = 0; d < 3; ++d) side = std::max(side, b.max[d] - b.min[d]);
  }
  if (!(side > 0)) return schema.step_m;  // all points equal: any step will do
  double fine = side * kFinest, coarse = side * kCoarsest;
  for (int i = 0; i < 11; ++i) {
    if (stop != nullptr && stop->load()) return make_error(ErrorCode::kCancelled, "interrupted");
    const double middle = std::sqrt(fine * coarse);
    MAPCODEC_ASSIGN(const double bits, bits_at(middle, sample, schema, settings, arena));
    (bits > bits_per_point ? fine : coarse) = middle;
  }
  if (coarse > side * kCoarsest * 0.99) {
    return make_error(ErrorCode::kInvalidArgument,
                      "the asked size cannot be reached: channels take more than that alone");
  }
  return coarse;
}

Result<double> find_step_for_color(std::size_t channel, const TileSet& tiles, const MapSchema& schema,
                                   Arena& arena) {
  MAPCODEC_ASSIGN(const std::vector<PointCloud> sample, sample_tiles(tiles));
  // Room below the bound for what coding itself loses, and for tiles that the sample did not show.
  const double wanted = 0.8 * schema.channels[channel].bound;
  double fine = schema.step_m / 64, coarse = schema.step_m;
  MAPCODEC_ASSIGN(const double floor, color_floor_at(coarse, channel, sample, schema, arena));
  if (floor <= wanted) return coarse;
  for (int i = 0; i < 7; ++i) {
    const double middle = std::sqrt(fine * coarse);
    MAPCODEC_ASSIGN(const double error, color_floor_at(middle, channel, sample, schema, arena));
    (error <= wanted ? fine : coarse) = middle;
  }
  return fine;
}

}  // namespace mapcodec
