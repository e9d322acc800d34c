// SPDX-License-Identifier: GPL-3.0-or-later
// Writes small valid inputs for every fuzz target, in the layout that the target's first lines describe. They
// are made by the encoders of the day, so they never fall behind the formats. Usage: make_seeds FOLDER
// (FOLDER/<target>/<number>)
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/attribute/coarse_color.hpp"
#include "mapcodec/codec/lossless_encoder.hpp"
#include "mapcodec/codec/occupancy_encoder.hpp"
#include "mapcodec/codec/points_encoder.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "mapcodec/codec/tile_segments.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "maps/map_writer.hpp"
#include "slam_adapter/octomap/octree_file.hpp"
#include "tests/fuzz/file_seeds.hpp"
#include "tests/fuzz/seeds.hpp"
#include "tests/unit/occupancy_support.hpp"

namespace mapcodec::fuzz {
namespace {

/// A floor and a wall with noise and a few doubles.
std::vector<Vec3> corner(std::size_t count) {
  std::mt19937 random(7);
  const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<Vec3> xyz;
  while (xyz.size() < count) {
    const double u = uniform(), v = uniform(), noise = 0.01 * uniform();
    xyz.push_back(random() % 2 == 0 ? Vec3{u, v, noise} : Vec3{noise, u, v});
    if (random() % 8 == 0) xyz.push_back(xyz.back());
  }
  xyz.resize(count);
  return xyz;
}

void points_seeds(SeedFolder& folder) {
  for (const std::size_t count : {1u, 20u, 300u}) {
    for (const Effort effort : {Effort::fast, Effort::standard, Effort::high}) {
      const auto encoded =
          encode_points(corner(count), Quantizer{{0, 0, 0}, 0.01, CoordinateFormat::Kind::f32},
                        PointsSettings{effort, true});
      if (!encoded.ok()) continue;
      Bytes seed{std::uint8_t(count), std::uint8_t(count >> 8), 0};
      seed.insert(seed.end(), encoded->bytes.begin(), encoded->bytes.end());
      folder.write("points", seed);
    }
  }
}

void octree_seeds(SeedFolder& folder) {
  for (const OccupancyKind kind : test::kAllKinds) {
    for (const double radius : {1.5, 4.0}) {
      const OccupancyTree tree = test::bubble(kind, radius);
      folder.write("occupancy", encode_occupancy_tile({{0, 0, 0, 16}, tree}, 0.1).bytes);
      folder.write("octree", format_octree(tree, 0.1, OctreeFormat::bt));
      folder.write("octree", format_octree(tree, 0.1, OctreeFormat::ot));
    }
  }
  OccupancyTree odd = test::bubble(OccupancyKind::color, 2);
  odd.levels[2].node_values.front() = 0x7fc00000;  // inner nodes that are not what their children say
  odd.levels[1].node_colors.front() = {1, 2, 3};
  folder.write("occupancy", encode_occupancy_tile({{0, 0, 0, 16}, odd}, 0.1).bytes);
  OccupancyTree leaf;
  leaf.root = Cell::free;
  folder.write("occupancy", encode_occupancy_tile({{0, 0, 0, 16}, leaf}, 0.1).bytes);
}

/// Byte 0: level; then a payload of several segments (segments_fuzz.cpp).
void segment_seeds(SeedFolder& folder) {
  MapSchema schema;
  schema.tile_size_m = 4;
  schema.step_m = 0.01;
  Erasure erasure;
  erasure.box = Box{{0, 0, 0}, {1, 1, 1}};
  erasure.motion = std::array<double, 12>{0, -1, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0};
  std::vector<Bytes> segments;
  for (const CodecId codec : {CodecId::points, CodecId::surface, CodecId::points}) {
    PointCloud cloud;
    cloud.xyz = corner(40);
    TileSettings settings;
    settings.codec = codec;
    auto tile = encode_tile(cloud, schema, settings);
    if (!tile) continue;
    segments.push_back(std::move(tile->bytes));
    segments.push_back(write_erasure(erasure));
    erasure.sphere = Erasure::Sphere{{0, 0, 0}, 0.5};
    erasure.inverse = !erasure.inverse;
    Bytes seed{3};
    const Bytes joined = join_segments(segments);
    seed.insert(seed.end(), joined.begin(), joined.end());
    folder.write("segments", seed);
  }
}

/// Bytes 0 and 1: number of points; byte 2: levels, 0 for all (surface_fuzz.cpp).
void surface_seeds(SeedFolder& folder) {
  for (const std::size_t count : {1u, 20u, 1000u, 5000u}) {
    for (const double step : {0.002, 0.02, 0.2}) {
      auto encoded =
          encode_surface(corner(count), Quantizer{{0, 0, 0}, step, CoordinateFormat::Kind::f32}, {});
      if (!encoded.ok()) continue;
      if (count > 20) (void)set_voxels(*encoded, surface::least_voxel_shift(encoded->header.depth));
      Bytes seed{std::uint8_t(count), std::uint8_t(count >> 8), std::uint8_t(count == 5000 ? 20 : 0)};
      seed.insert(seed.end(), encoded->bytes.begin(), encoded->bytes.end());
      folder.write("surface", seed);
    }
  }
}

constexpr std::size_t kCount = 200;

std::vector<VoxelCoord> channel_voxels() {
  std::vector<VoxelCoord> voxels;
  for (std::uint64_t i = 0; i < kCount; ++i) voxels.push_back(morton_decode(i * i / 2 * 5));
  return voxels;
}

/// Byte 0: scalar type, colour, components; byte 1: number of points (channel_fuzz.cpp).
void channel_seed(SeedFolder& folder, std::uint8_t choice, ChannelSchema schema) {
  const std::vector<VoxelCoord> voxels = channel_voxels();
  Channel values{schema.info, Bytes(kCount * schema.info.stride())};
  for (std::size_t i = 0; i < values.data.size(); ++i) values.data[i] = std::uint8_t(i % 4 == 3 ? 64 : i / 5);
  const auto encoded = encode_channel(schema, values, voxels, Effort::standard);
  if (!encoded.ok()) return;
  Bytes seed{choice, std::uint8_t(kCount)};
  seed.insert(seed.end(), encoded->bytes.begin(), encoded->bytes.end());
  folder.write("channel", seed);
}

/// Colours as surfaces have them.
void coarse_color_seed(SeedFolder& folder, std::uint32_t step) {
  const std::vector<VoxelCoord> voxels = channel_voxels();
  ColorAims aims;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto level = static_cast<float>(i % 7 == 3 ? 200 : i);
    aims.rgb.push_back({level, 100, level / 2});
    aims.weights.push_back(1);
  }
  CoarseColorEncoder encoder(voxels, {"rgb", ScalarType::u8, 3}, ColorScale::eight);
  const CoarseColors encoded = encoder.encode(aims, step, 1, CoarseColorEncoder::kUsualTrust);
  Bytes seed{30, std::uint8_t(kCount)};
  seed.insert(seed.end(), encoded.bytes.begin(), encoded.bytes.end());
  folder.write("channel", seed);
}

void channel_seeds(SeedFolder& folder) {
  for (const std::uint32_t step : {40u, 400u}) coarse_color_seed(folder, step);
  for (const auto kept : {ChannelKept::exact, ChannelKept::bounded}) {
    const double bound = kept == ChannelKept::bounded ? 5 : 0;
    channel_seed(folder, 30, {{"rgb", ScalarType::u8, 3}, kept, bound, {}});
    channel_seed(folder, 8, {{"any", ScalarType::f32, 1}, kept, bound, {}});
    channel_seed(folder, 2, {{"any", ScalarType::u16, 1}, kept, bound, {}});
    channel_seed(folder, 64 + 5, {{"any", ScalarType::i32, 3}, kept, bound, {}});
  }
}

/// Byte 0: kind of the coordinates; bytes 1 and 2: number of points (lossless_fuzz.cpp).
void lossless_seeds(SeedFolder& folder) {
  for (const auto kind :
       {CoordinateFormat::Kind::f32, CoordinateFormat::Kind::f64, CoordinateFormat::Kind::fixed}) {
    CoordinateFormat format{kind, {0.01, 0.01, 0.001}, {5e5, 4e6, 0}};
    std::vector<Vec3> xyz = corner(250);
    for (Vec3& p : xyz) {
      for (double& v : p) v = static_cast<float>(v);
    }
    xyz.push_back({std::nan(""), 0, -0.0});
    const auto encoded = encode_lossless(xyz, format, {0, 0, 0}, Effort::standard);
    if (!encoded.ok()) continue;
    Bytes seed{std::uint8_t(static_cast<int>(kind) - 1), std::uint8_t(xyz.size()), 0};
    seed.insert(seed.end(), encoded->bytes.begin(), encoded->bytes.end());
    folder.write("lossless", seed);
  }
}

/// An archive as it lies on the disk, of one commit or two.
void archive_seed(SeedFolder& folder, std::int32_t tiles, int commits) {
  MapInfo info;
  info.schema = write_schema(MapSchema{});
  info.bounds.add(Vec3{0, 0, 0});
  info.bounds.add(Vec3{3, 3, 3});
  auto writer = MapWriter::create(folder.next_path("archive"), info, true);
  for (std::int32_t i = 0; writer.ok() && i < tiles * commits; ++i) {
    const Box bounds = tile_cube({i, -i, 0, 0}, info.origin, info.tile_size_m);
    const Bytes payload(std::size_t(10 + i), std::uint8_t(i));
    if (!writer->add({i, -i, 0, 0}, 2, 100, bounds, {0.001, 0.002, 3, 0.1}, payload).ok()) return;
    if ((i + 1) % tiles == 0 && !writer->commit(1700000000).ok()) return;
  }
}

}  // namespace
}  // namespace mapcodec::fuzz

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  mapcodec::fuzz::SeedFolder folder(argv[1]);
  mapcodec::fuzz::points_seeds(folder);
  mapcodec::fuzz::surface_seeds(folder);
  mapcodec::fuzz::segment_seeds(folder);
  mapcodec::fuzz::octree_seeds(folder);
  mapcodec::fuzz::channel_seeds(folder);
  mapcodec::fuzz::lossless_seeds(folder);
  mapcodec::fuzz::archive_seed(folder, 1, 1);
  mapcodec::fuzz::archive_seed(folder, 5, 1);
  mapcodec::fuzz::archive_seed(folder, 3, 2);
#ifdef MAPCODEC_FILE_SEEDS
  mapcodec::fuzz::file_seeds(folder);
#endif
  std::printf("%zu seeds in %s\n", folder.count(), argv[1]);
  return folder.good() ? 0 : 1;
}
