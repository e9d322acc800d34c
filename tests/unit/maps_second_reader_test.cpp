// SPDX-License-Identifier: GPL-3.0-or-later
// Writes an archive and its listing for tests/support/read_archive.py, which another ctest runs on them.
#include "tests/unit/maps_support.hpp"

#include <cstdlib>

namespace mapcodec {
namespace {

using namespace maps_test;

std::string print(const char* format, auto... values) {
  char text[256];
  std::snprintf(text, sizeof(text), format, values...);
  return text;
}

std::string tile_line(const TileRecord& t) {
  std::string line = print("tile %u %u %d %d %d codec %u points %llu errors %.9g %.9g %.9g %.9g segments",
                           t.submap, unsigned{t.key.level}, t.key.x, t.key.y, t.key.z, unsigned{t.codec},
                           static_cast<unsigned long long>(t.points), t.errors.rms_m,
                           t.errors.max_axis_error_m, t.errors.color_error, t.errors.density_error);
  for (const SegmentRef& s : t.segments) {
    line += print(" %llu+%u:%08x", static_cast<unsigned long long>(s.offset), s.length, s.crc);
  }
  return line;
}

std::string hash_line(const TileRecord& t) {
  std::string line =
      print("hashes %u %u %d %d %d", t.submap, unsigned{t.key.level}, t.key.x, t.key.y, t.key.z);
  for (const ContentHash& h : t.hashes) line += " " + h.to_string();
  return line;
}

void write_sample(const std::string& path) {
  MapInfo info = sample_info();
  std::mt19937_64 random(6);
  auto tiles = random_tiles(150, info, 6);
  tiles.push_back(random_tile(TileKey::unplaced(), info, random));
  tiles.push_back(random_tile({2, -7, 1, 3}, info, random));
  write_map(path, info, tiles);
  auto writer = MapWriter::open(path);
  ASSERT_TRUE(writer.ok());
  info.submaps = {{"", {0, 0, 0}, {0, 0, 0, 1}, 1, 2}, {"second", {1, 2, 3}, {0, 0, 0, 1}, 3, 4}};
  info.snapshots = {{"first", 1}};
  info.extras["note"] = {1, 2, 3};
  ASSERT_TRUE(writer->set_info(info).ok());
  for (int i = 0; i < 3; ++i)
    add_tile(*writer, random_tile({1, 1, i, 0}, info, random));  // some replace, all twice
  for (int i = 0; i < 3; ++i) add_tile(*writer, random_tile({1, 1, i, 0}, info, random));
  ASSERT_TRUE(writer->remove(tiles[17].key).ok());
  ASSERT_TRUE(writer->remove(tiles[18].key).ok());
  ASSERT_TRUE(writer->extend(tiles[20].key, 5, tiles[20].bounds, tiles[20].errors, random_bytes(10, 1)).ok());
  ASSERT_TRUE(writer->add({1, 2, 3, 0}, 7, 8, {}, {}, random_bytes(10, 2), 1).ok());
  ASSERT_TRUE(writer->commit(1'700'000'500).ok());
  writer->store_hashes(true);
  const Bytes big = random_bytes(700000, 3);  // long enough for waypoints
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(writer->add({i, 3, 3, 0}, 1, 1, {}, {}, big).ok());
  ASSERT_TRUE(writer->commit(1'700'000'600).ok());
}

TEST(SecondReader, WriteSample) {
  TemporaryFolder folder;
  const char* wanted = std::getenv("MAPCODEC_SAMPLE_ARCHIVE");
  const std::string path = wanted ? wanted : folder.path("sample.mapc");
  write_sample(path);
  const auto archive = MapArchive::open(path);
  ASSERT_TRUE(archive.ok());
  EXPECT_TRUE(archive->verify()->ok());
  std::ofstream list(path + ".txt");
  for (std::uint64_t revision = 1; revision <= 3; ++revision) {
    const auto then = MapArchive::open(path, revision);
    ASSERT_TRUE(then.ok());
    std::uint64_t points = 0;
    for (const TileRecord& t : then->tiles()) points += t.points;
    list << "revision " << revision << " time " << then->timestamp_s() << " tiles " << then->tiles().size()
         << " points " << points << '\n';
  }
  const MapInfo& info = archive->info();
  list << "format " << kArchiveFormatVersion
       << print(" origin %.9g %.9g %.9g tile_size %.9g", info.origin[0], info.origin[1], info.origin[2],
                info.tile_size_m)
       << " input_points " << info.input_points << '\n';
  for (const TileRecord& t : archive->tiles()) list << tile_line(t) << '\n';
  std::size_t hashed = 0;
  for (const TileRecord& t : archive->tiles()) {
    if (!t.hashes.empty()) list << hash_line(t) << '\n', ++hashed;
  }
  EXPECT_EQ(hashed, 4u);
}

}  // namespace
}  // namespace mapcodec
