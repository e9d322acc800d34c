// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rate_search.hpp"

#include "parallel/runner.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kSampleTiles = 8;
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

Result<double> bits_at(double step_m, const std::vector<PointCloud>& sample, MapSchema schema,
                       const TileSettings& settings, Arena& arena) {
  schema.step_m = step_m;
  std::vector<std::optional<Error>> errors(sample.size());
  std::vector<std::uint64_t> bytes(sample.size());
  TbbRunner(arena).run(sample.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto tile = encode_tile(sample[i], schema, settings);
      if (tile.ok()) {
        bytes[i] = tile->bytes.size();
      } else {
        errors[i] = tile.error();
      }
    }
  });
  double total = 0, points = 0;
  for (std::size_t i = 0; i < sample.size(); ++i) {
    if (errors[i]) return *errors[i];
    total += 8.0 * double(bytes[i]);
    points += double(sample[i].size());
  }
  return total / points;
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
  for (int i = 0; i < 14; ++i) {
    if (stop != nullptr && stop->load()) return make_error(ErrorCode::kCancelled, "interrupted");
    const double middle = std::sqrt(fine * coarse);
    MAPCODEC_ASSIGN(const double bits, bits_at(middle, sample, schema, settings, arena));
    (bits > bits_per_point ? fine : coarse) = middle;
  }
  if (coarse > side * kCoarsest * 0.99) {
    return make_error(ErrorCode::kInvalidArgument, "the asked size cannot be reached: channels take more than that alone");
  }
  return coarse;
}

}  // namespace mapcodec
