// SPDX-License-Identifier: GPL-3.0-or-later
// Small maps of random bytes for the tests of maps/.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "mapcodec/cloud/map_schema.hpp"
#include "maps/map_archive.hpp"
#include "maps/map_writer.hpp"

namespace mapcodec::maps_test {

/// A folder that goes away with the test.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "mapcodec-maps-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }
  [[nodiscard]] std::size_t files() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder_), {}));
  }

 private:
  std::filesystem::path folder_;
};

inline Bytes read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}
inline void write_file(const std::string& path, ByteSpan bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

inline Bytes random_bytes(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Bytes bytes(count);
  for (std::uint8_t& b : bytes) b = static_cast<std::uint8_t>(random());
  return bytes;
}

/// A schema as a coloured map has it.
inline MapSchema coloured_schema(const Vec3& origin, double tile_size_m) {
  MapSchema schema;
  schema.promise_value = 0.005;
  schema.origin = origin;
  schema.tile_size_m = tile_size_m;
  schema.step_m = 0.01;
  ChannelSchema rgb;
  rgb.info = {"rgb", ScalarType::u8, 3};
  rgb.kept = ChannelKept::bounded;
  rgb.bound = 10;
  schema.channels.push_back(rgb);
  return schema;
}

inline MapInfo sample_info(const Vec3& origin = {412345.678, 5412345.123, 321.987},
                           double tile_size_m = 3.7) {
  MapInfo info;
  info.schema = write_schema(coloured_schema(origin, tile_size_m));
  info.origin = origin;
  info.tile_size_m = tile_size_m;
  info.input_points = 460400;
  info.input_bytes = 14732976;
  info.dropped_points = 17;
  info.achieved = {0.0028871, 0.0049999987, 8.7654321, 0.0123456};
  info.bounds.add(Vec3{origin[0] + 0.123456789, origin[1] + 0.2345678901, origin[2] + 0.3456789012});
  info.bounds.add(Vec3{origin[0] + 3.512345678, origin[1] + 3.6123456789, origin[2] + 2.7123456789});
  return info;
}

struct SampleTile {
  TileKey key;
  std::uint8_t codec = 2;
  std::uint64_t points = 0;
  Box bounds;
  TileErrors errors;
  Bytes bytes;
};

inline Box random_box(const Box& cube, std::mt19937_64& random) {
  std::uniform_real_distribution<double> part(0, 1);
  Box box;
  for (int corner = 0; corner < 2; ++corner) {
    Vec3 p;
    for (std::size_t d = 0; d < 3; ++d) p[d] = cube.min[d] + part(random) * (cube.max[d] - cube.min[d]);
    box.add(p);
  }
  return box;
}

/// A tile with random length, count, bounds and errors.
inline SampleTile random_tile(const TileKey& key, const MapInfo& info, std::mt19937_64& random,
                              std::size_t most_bytes = 300, std::uint64_t most_points = 100000) {
  std::uniform_real_distribution<double> part(0, 1);
  SampleTile tile;
  tile.key = key;
  tile.points = 1 + random() % most_points;
  if (!key.is_unplaced()) tile.bounds = random_box(tile_cube(key, info.origin, info.tile_size_m), random);
  tile.errors = {0.003 * part(random), 0.005 * part(random), 10 * part(random), part(random)};
  tile.bytes = random_bytes(1 + random() % most_bytes, random());
  return tile;
}

/// `count` tiles in Morton order; about half of a cube is occupied, some keys are negative.
inline std::vector<SampleTile> random_tiles(std::size_t count, const MapInfo& info, std::uint64_t seed,
                                            std::size_t most_bytes = 300) {
  std::mt19937_64 random(seed);
  const int side = 1 + static_cast<int>(std::cbrt(2.0 * static_cast<double>(count)));
  std::set<TileKey, MortonLess> keys;
  while (keys.size() < count) {
    keys.insert({static_cast<int>(random() % static_cast<unsigned>(side)) - side / 2,
                 static_cast<int>(random() % static_cast<unsigned>(side)) - side / 2,
                 static_cast<int>(random() % static_cast<unsigned>(side)), 0});
  }
  std::vector<SampleTile> tiles;
  for (const TileKey& key : keys) tiles.push_back(random_tile(key, info, random, most_bytes));
  return tiles;
}

inline void add_tile(MapWriter& writer, const SampleTile& t) {
  const Status added = writer.add(t.key, t.codec, t.points, t.bounds, t.errors, t.bytes);
  ASSERT_TRUE(added.ok()) << added.error().to_string();
}

inline void write_map(const std::string& path, const MapInfo& info, const std::vector<SampleTile>& tiles) {
  auto writer = MapWriter::create(path, info, true);
  ASSERT_TRUE(writer.ok()) << writer.error().to_string();
  for (const SampleTile& t : tiles) add_tile(*writer, t);
  const auto revision = writer->commit(1'700'000'000);
  ASSERT_TRUE(revision.ok()) << revision.error().to_string();
  EXPECT_EQ(*revision, 1u);
}

inline std::uint64_t payload_bytes(const std::vector<SampleTile>& tiles) {
  std::uint64_t sum = 0;
  for (const SampleTile& t : tiles) sum += t.bytes.size();
  return sum;
}

inline void expect_contains(const Box& outer, const Box& inner) {
  EXPECT_TRUE(outer.contains(inner.min));
  EXPECT_TRUE(outer.contains(inner.max));
}

/// Of a map of these tiles: the largest, and for the RMS the pooled one.
inline TileErrors achieved_by(const std::vector<SampleTile>& tiles) {
  TileErrors e;
  double squares = 0;
  for (const SampleTile& t : tiles) {
    squares += t.errors.rms_m * t.errors.rms_m;
    e.max_axis_error_m = std::max(e.max_axis_error_m, t.errors.max_axis_error_m);
    e.color_error = std::max(e.color_error, t.errors.color_error);
    e.density_error = std::max(e.density_error, t.errors.density_error);
  }
  if (!tiles.empty()) e.rms_m = std::sqrt(squares / static_cast<double>(tiles.size()));
  return e;
}

/// The record says what was added, within the index's rounding; the segment holds the bytes.
inline void expect_same(const MapArchive& archive, const TileRecord& record, const SampleTile& tile) {
  EXPECT_EQ(record.key, tile.key);
  EXPECT_EQ(record.codec, tile.codec);
  EXPECT_EQ(record.points, tile.points);
  if (!tile.bounds.empty()) expect_contains(record.bounds, tile.bounds);
  EXPECT_GE(record.errors.rms_m, tile.errors.rms_m);
  EXPECT_GE(record.errors.max_axis_error_m, tile.errors.max_axis_error_m);
  ASSERT_EQ(record.segments.size(), 1u);
  const auto bytes = archive.read(record.segments[0]);
  ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
  EXPECT_EQ(*bytes, tile.bytes);
}

inline Result<MapArchive> open_bytes(Bytes bytes, std::optional<std::uint64_t> revision = std::nullopt) {
  return MapArchive::open(std::make_unique<MemoryStore>(std::move(bytes)), revision);
}

/// Opens, reads and verifies whatever these bytes are. Never crashes; says whether all of it was in order.
inline bool is_flawless(const Bytes& bytes) {
  const auto archive = open_bytes(bytes);
  if (!archive.ok()) return false;
  bool good = true;
  for (const TileRecord& tile : archive->tiles()) {
    for (const SegmentRef& s : tile.segments) good = archive->read(s).ok() && good;
  }
  const auto report = archive->verify();
  return good && report.ok() && report->ok();
}

}  // namespace mapcodec::maps_test
