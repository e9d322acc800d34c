// SPDX-License-Identifier: GPL-3.0-or-later
// What goes in comes out, and how many bytes the container adds.
#include "tests/unit/maps_support.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/wait.h>

#include <cmath>
#include <thread>

#include "maps/column_codec.hpp"
#include "maps/file_store.hpp"
#include "maps/tile_bounds.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

std::uint64_t overhead(std::size_t tiles_wanted, MapInfo info, std::size_t most_bytes) {
  TemporaryFolder folder;
  const auto tiles = random_tiles(tiles_wanted, info, tiles_wanted, most_bytes);
  info.achieved = achieved_by(tiles);
  info.input_points = 0;
  for (const SampleTile& t : tiles) info.input_points += t.points;
  write_map(folder.path("m.mapc"), info, tiles);
  return std::filesystem::file_size(folder.path("m.mapc")) - payload_bytes(tiles);
}

TEST(MapArchive, RoundTrip) {
  for (const std::size_t count : {0u, 1u, 2u, 15u, 16u, 500u}) {
    TemporaryFolder folder;
    const std::string path = folder.path("m.mapc");
    const MapInfo info = sample_info();
    const auto tiles = random_tiles(count, info, 7 + count);
    write_map(path, info, tiles);
    const auto archive = MapArchive::open(path);
    ASSERT_TRUE(archive.ok()) << archive.error().to_string();
    ASSERT_EQ(archive->tiles().size(), count);
    EXPECT_EQ(archive->revision(), 1u);
    EXPECT_EQ(archive->timestamp_s(), 1'700'000'000);
    EXPECT_EQ(archive->file_bytes(), std::filesystem::file_size(path));
    for (std::size_t i = 0; i < count; ++i) {
      expect_same(*archive, archive->tiles()[i], tiles[i]);
      EXPECT_EQ(archive->find(tiles[i].key), i);
    }
    const auto report = archive->verify();
    ASSERT_TRUE(report.ok());
    EXPECT_TRUE(report->ok());
    EXPECT_EQ(report->checked_bytes, report->file_bytes);
    EXPECT_EQ(report->live_bytes, payload_bytes(tiles));
    EXPECT_EQ(report->dead_bytes, 0u);
    EXPECT_EQ(folder.files(), 1u);
  }
}

TEST(MapArchive, KeepsTheMapsFacts) {
  for (const double far : {0.0, -12.5, 5e6}) {
    TemporaryFolder folder;
    MapInfo info = sample_info({far, far + 0.1, -far}, 2.5);
    info.flags = 5;
    info.submaps = {{"", {1, 2, 3}, {0, 0, 0, 1}, 10, 20}, {"kitchen", {4, 5, 6}, {0, 0, 1, 0}, 30, 40}};
    info.snapshots = {{"before", 1}};
    info.extras["colour"] = {1, 2, 3};
    write_map(folder.path("m.mapc"), info, random_tiles(3, info, 1));
    const auto archive = MapArchive::open(folder.path("m.mapc"));
    ASSERT_TRUE(archive.ok()) << archive.error().to_string();
    const MapInfo& got = archive->info();
    EXPECT_EQ(got.schema, info.schema);
    EXPECT_EQ(got.origin, info.origin);
    EXPECT_EQ(got.tile_size_m, info.tile_size_m);
    EXPECT_EQ(got.input_points, info.input_points);
    EXPECT_EQ(got.input_bytes, info.input_bytes);
    EXPECT_EQ(got.dropped_points, info.dropped_points);
    EXPECT_EQ(got.achieved.max_axis_error_m, info.achieved.max_axis_error_m);
    EXPECT_GE(got.achieved.rms_m, info.achieved.rms_m);
    EXPECT_LE(got.achieved.rms_m, info.achieved.rms_m * (1 + 2e-7));
    EXPECT_GE(got.achieved.color_error, info.achieved.color_error);
    EXPECT_GE(got.achieved.density_error, info.achieved.density_error);
    expect_contains(got.bounds, info.bounds);
    for (std::size_t d = 0; d < 3; ++d) {
      EXPECT_NEAR(got.bounds.min[d], info.bounds.min[d], 1.01 * info.tile_size_m / (1 << 20));
      EXPECT_NEAR(got.bounds.max[d], info.bounds.max[d], 1.01 * info.tile_size_m / (1 << 20));
    }
    EXPECT_EQ(got.flags, info.flags);
    EXPECT_EQ(got.submaps, info.submaps);
    EXPECT_EQ(got.snapshots, info.snapshots);
    EXPECT_EQ(got.extras, info.extras);
  }
}

TEST(MapArchive, SameInputSameBytes) {
  TemporaryFolder folder;
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(100, info, 3);
  write_map(folder.path("a.mapc"), info, tiles);
  write_map(folder.path("b.mapc"), info, tiles);
  EXPECT_EQ(read_file(folder.path("a.mapc")), read_file(folder.path("b.mapc")));
}

TEST(MapArchive, UnplacedTileComesLastAndMeetsNoBox) {
  TemporaryFolder folder;
  const MapInfo info = sample_info();
  auto tiles = random_tiles(5, info, 3);
  std::mt19937_64 random(1);
  tiles.push_back(random_tile(TileKey::unplaced(), info, random));
  write_map(folder.path("m.mapc"), info, tiles);
  const auto archive = MapArchive::open(folder.path("m.mapc"));
  ASSERT_TRUE(archive.ok());
  ASSERT_EQ(archive->tiles().size(), 6u);
  EXPECT_TRUE(archive->tiles()[5].key.is_unplaced());
  EXPECT_TRUE(archive->tiles()[5].bounds.empty());
  EXPECT_EQ(archive->tiles_in({{-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9}}).size(), 5u);
  expect_same(*archive, archive->tiles()[5], tiles[5]);
}

TEST(MapArchive, LevelsAndSubmaps) {
  auto writer = MapWriter::create(std::make_unique<MemoryStore>(), sample_info());
  ASSERT_TRUE(writer.ok());
  const Bytes bytes{1, 2, 3};
  const Box box;
  const TileKey keys[] = {{0, 0, 0, 3}, {0, 0, 0, 0}, {-1, -1, -1, 30}, {2147483647, -2147483647 - 1, 5, 30}};
  for (const std::uint32_t submap : {7u, 0u, 4294967295u}) {
    for (const TileKey& key : keys)
      ASSERT_TRUE(writer->add(key, 255, ~std::uint64_t{0}, box, {}, bytes, submap).ok());
  }
  EXPECT_FALSE(writer->add({0, 0, 0, 31}, 1, 1, box, {}, bytes).ok());
  EXPECT_EQ(writer->tile_count(), 12u);
  ASSERT_TRUE(writer->commit(0).ok());
}

TEST(MapArchive, FindsTilesInABoxAndReadsOnlyThem) {
  TemporaryFolder folder;
  const MapInfo info = sample_info({0, 0, 0}, 1.0);
  const auto tiles = random_tiles(300, info, 5, 5000);
  write_map(folder.path("m.mapc"), info, tiles);
  const auto archive = MapArchive::open(folder.path("m.mapc"));
  ASSERT_TRUE(archive.ok());
  const Box box{{-0.5, -0.5, 0.2}, {1.1, 0.7, 1.4}};
  const auto found = archive->tiles_in(box);
  const std::set<std::size_t> set(found.begin(), found.end());
  EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (tiles[i].bounds.intersects(box)) {
      EXPECT_TRUE(set.count(i));
    }
  }
  EXPECT_GT(found.size(), 0u);
  EXPECT_LT(found.size(), 60u);
  const std::uint64_t before = archive->bytes_read();
  EXPECT_LT(before, 10000u);
  std::uint64_t wanted = 0;
  for (const std::size_t i : found) {
    ASSERT_TRUE(archive->read(archive->tiles()[i].segments[0]).ok());
    wanted += tiles[i].bytes.size();
  }
  EXPECT_EQ(archive->bytes_read() - before, wanted);
}

TEST(MapArchive, ManyThreadsRead) {
  TemporaryFolder folder;
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(64, info, 5);
  write_map(folder.path("m.mapc"), info, tiles);
  const auto archive = MapArchive::open(folder.path("m.mapc"));
  ASSERT_TRUE(archive.ok());
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        const auto bytes = archive->read(archive->tiles()[i].segments[0]);
        if (!bytes.ok() || *bytes != tiles[i].bytes) ++wrong;
      }
    });
  }
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(wrong, 0);
}

TEST(MapArchiveSize, OneTileCostsLessThan200Bytes) {
  MapInfo info = sample_info();
  for (const TileKey& key : {TileKey{0, 0, 0, 0}, TileKey{-3, 5, 2, 0}}) {
    auto store = std::make_unique<MemoryStore>();
    const MemoryStore& bytes = *store;
    std::mt19937_64 random(1);
    const SampleTile tile = random_tile(key, info, random, 50000, 460400);
    info.achieved = tile.errors;
    info.input_points = tile.points;
    auto writer = MapWriter::create(std::move(store), info);
    ASSERT_TRUE(writer.ok());
    add_tile(*writer, tile);
    ASSERT_TRUE(writer->commit(1'700'000'000).ok());
    const std::size_t cost = bytes.bytes().size() - tile.bytes.size();
    RecordProperty("overhead_one_tile", static_cast<int>(cost));
    std::printf("one tile: %zu bytes of overhead, %zu of them the schema\n", cost, info.schema.size());
    EXPECT_LT(cost, 200u);
    EXPECT_LT(cost - info.schema.size(), 112u);  // so that a schema of 88 bytes still fits
  }
}

TEST(MapArchiveSize, FurtherTilesCostLessThan16Bytes) {
  const MapInfo info = sample_info();
  const double one = static_cast<double>(overhead(1, info, 100000));
  for (const std::size_t count : {2u, 5u, 10u, 20u, 50u, 100u, 300u, 1000u, 3000u}) {
    const double each =
        (static_cast<double>(overhead(count, info, 100000)) - one) / static_cast<double>(count - 1);
    std::printf("%5zu tiles: %.2f bytes for each further one\n", count, each);
    if (count >= 1000) {
      EXPECT_LT(each, 16.0);
    }
    EXPECT_LT(each * static_cast<double>(count - 1) + one, 200 + 16.0 * static_cast<double>(count)) << count;
  }
}

TEST(Column, RoundTrip) {
  std::mt19937_64 random(4);
  for (const std::size_t count : {0u, 1u, 2u, 15u, 16u, 17u, 1000u}) {
    for (unsigned width = 0; width <= 64; ++width) {
      std::vector<std::uint64_t> values(count);
      for (auto& v : values) v = width == 0 ? 42 : random() >> (64 - width);
      if (width % 3 == 1) std::sort(values.begin(), values.end());
      ByteWriter out;
      write_column(out, values);
      ByteReader in(out.bytes());
      const auto got = read_column(in, count);
      ASSERT_TRUE(got.ok());
      EXPECT_EQ(*got, values);
      EXPECT_EQ(in.left(), 0u);
    }
  }
}

TEST(Column, RefusesNonsense) {
  const auto read = [](Bytes bytes, std::size_t count) {
    ByteReader in(bytes);
    return read_column(in, count).ok();
  };
  EXPECT_FALSE(read({}, 1));
  EXPECT_FALSE(read({0x89, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9}, 2));  // unknown form
  EXPECT_FALSE(read({0x80, 0, 1, 0}, 2));                       // no planes
  EXPECT_FALSE(read({8, 0, 1}, 2));                             // too short
  EXPECT_FALSE(read({0x81, 0, 3, 1, 2, 3}, 2));                 // no zstd frame
  EXPECT_FALSE(
      read({1, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1, 3}, 2));  // a sum beyond 64 bits
}

TEST(TileBounds, ContainAndStayPut) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> part(-0.3, 1.3);
  for (int i = 0; i < 20000; ++i) {
    const Vec3 origin{1e6 * part(random), 5e6 * part(random), part(random)};
    const double size = std::ldexp(part(random) + 0.4, static_cast<int>(random() % 20) - 8);
    const TileKey key{static_cast<int>(random() % 2000) - 1000, static_cast<int>(random() % 20), 0,
                      static_cast<std::uint8_t>(random() % 4)};
    const Box cube = tile_cube(key, origin, size);
    const double side = cube.max[0] - cube.min[0];
    Box box;
    for (int c = 0; c < 2; ++c) {
      box.add(Vec3{cube.min[0] + side * part(random), cube.min[1] + side * part(random),
                   cube.min[2] + side * part(random)});
    }
    if (i % 3 == 0) box = cube;
    const auto code = encode_bounds(box, key, origin, size);
    ASSERT_TRUE(code);
    ASSERT_TRUE(is_valid(*code));
    const Box outer = decode_bounds(*code, key, origin, size);
    expect_contains(outer, box);
    EXPECT_EQ(encode_bounds(outer, key, origin, size), code);
    if (i % 3 == 0) {
      EXPECT_EQ(*code, BoundsCode{});
    }
  }
}

TEST(TileBounds, EdgeCases) {
  EXPECT_FALSE(encode_bounds({{0, 0, NAN}, {1, 1, NAN}}, {}, {0, 0, 0}, 1));
  EXPECT_FALSE(encode_bounds({{-INFINITY, 0, 0}, {1, 1, 1}}, {}, {0, 0, 0}, 1));
  EXPECT_FALSE(encode_bounds({{-1e30, 0, 0}, {1, 1, 1}}, {}, {0, 0, 0}, 1));
  EXPECT_TRUE(encode_bounds({{-1e12, 0, 0}, {1, 1, 1}}, {}, {0, 0, 0}, 1));
  const auto point = encode_bounds({{0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}}, {}, {0, 0, 0}, 1);
  ASSERT_TRUE(point);
  EXPECT_TRUE(decode_bounds(*point, {}, {0, 0, 0}, 1).contains({0.5, 0.5, 0.5}));
}

TEST(MapWriter, RemovesWhatKilledWritersLeft) {
  TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ASSERT_GT(child, 0);
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  const std::string gone = std::to_string(child), here = std::to_string(::getpid());
  const std::string stale[] = {"m.mapc.tmp-" + gone + "-0", "m.mapc.tmp-" + gone + "-17"};
  const std::string kept[] = {
      "m.mapc.tmp-" + here + "-99",      // its writer lives
      "n.mapc.tmp-" + gone + "-0",       // another target
      "m.mapc.tmp-" + gone + "-0.note",  // not a name that a writer makes
      "m.mapc.tmp-" + gone,
      "m.mapc.tmp-0-0",
      "m.mapc.tmp--1-0",
      "m.mapc.tmp-99999999999999999999-0",
      "m.mapc.tmp-" + gone + "-5",  // locked: a writer whose process number means nothing here
  };
  for (const std::string& name : stale) write_file(folder.path(name), random_bytes(9, 1));
  for (const std::string& name : kept) write_file(folder.path(name), random_bytes(9, 2));
  std::filesystem::create_directory(folder.path("m.mapc.tmp-" + gone + "-6"));
  const FileHandle other(::open(folder.path(kept[7]).c_str(), O_RDWR));
  ASSERT_EQ(::flock(other.fd(), LOCK_EX | LOCK_NB), 0);
  const MapInfo info = sample_info();
  write_map(folder.path("m.mapc"), info, random_tiles(2, info, 5));
  EXPECT_TRUE(MapArchive::open(folder.path("m.mapc")).ok());
  for (const std::string& name : stale) EXPECT_FALSE(std::filesystem::exists(folder.path(name))) << name;
  for (const std::string& name : kept) EXPECT_TRUE(std::filesystem::exists(folder.path(name))) << name;
  EXPECT_EQ(folder.files(), std::size(kept) + 2);
}

}  // namespace
}  // namespace mapcodec
