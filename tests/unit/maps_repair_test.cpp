// SPDX-License-Identifier: GPL-3.0-or-later
// Repair: what is whole is saved, what is lost is named, the original is never touched.
#include "maps/compaction.hpp"
#include "tests/unit/maps_support.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

/// What a map holds: every tile with its bytes.
using Contents = std::map<std::string, Bytes>;

Contents contents(const MapArchive& archive) {
  Contents all;
  for (const TileRecord& t : archive.tiles()) {
    Bytes& bytes = all[tile_name(t)];
    for (const SegmentRef& s : t.segments) {
      const auto segment = archive.read(s);
      EXPECT_TRUE(segment.ok()) << segment.error().to_string();
      if (segment.ok()) bytes.insert(bytes.end(), segment->begin(), segment->end());
    }
  }
  return all;
}

/// Three revisions; a delta index, a name, and a tile of two segments.
void write_small(const std::string& path) {
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(24, info, 1, 30);
  std::mt19937_64 random(2);
  auto writer = MapWriter::create(path, info, true);
  for (const SampleTile& t : tiles) add_tile(*writer, t);
  ASSERT_TRUE(writer->commit(1).ok());
  add_tile(*writer, random_tile(tiles[3].key, info, random, 30));
  ASSERT_TRUE(writer->extend(tiles[5].key, 9, tiles[5].bounds, tiles[5].errors, Bytes{1, 2, 3}).ok());
  ASSERT_TRUE(writer->add_snapshot("first").ok());
  ASSERT_TRUE(writer->commit(2).ok());
  add_tile(*writer, random_tile({7, 7, 7, 0}, info, random, 30));
  ASSERT_TRUE(writer->commit(3).ok());
}

TEST(MapRepair, ASoundArchiveIsSavedWhole) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), fixed = folder.path("f.mapc");
  write_small(path);
  const Bytes before = read_file(path);
  const auto report = repair_archive(path, fixed);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_TRUE(report->saved_all());
  EXPECT_EQ(report->tiles_saved, 25u);
  EXPECT_EQ(contents(*MapArchive::open(fixed)), contents(*MapArchive::open(path)));
  EXPECT_EQ(MapArchive::open(fixed)->revision(), 3u);
  EXPECT_EQ(MapArchive::open(fixed)->resolve("first").value(), 1u);
  EXPECT_EQ(contents(*MapArchive::open(fixed, 1)), contents(*MapArchive::open(path, 1)));
  EXPECT_TRUE(verify_archive(fixed)->ok());
  EXPECT_EQ(read_file(path), before);
  EXPECT_EQ(repair_archive(path, fixed).error().code, ErrorCode::kCannotWrite);  // exists
  EXPECT_TRUE(repair_archive(path, fixed, true).ok());
  EXPECT_EQ(repair_archive(path, path, true).error().code, ErrorCode::kCannotWrite);
  std::filesystem::create_hard_link(path, folder.path("link"));
  EXPECT_EQ(repair_archive(path, folder.path("link"), true).error().code, ErrorCode::kCannotWrite);
  EXPECT_EQ(repair_archive(folder.path("none"), folder.path("g")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(repair_archive(folder.path("."), folder.path("g")).error().code, ErrorCode::kUnreadable);
  EXPECT_EQ(read_file(path), before);
}

TEST(MapRepair, ATornTailIsNoLoss) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), fixed = folder.path("f.mapc");
  write_small(path);
  Bytes bytes = read_file(path);
  bytes.insert(bytes.end(), 1000, 7);
  write_file(path, bytes);
  EXPECT_FALSE(verify_archive(path)->ok());
  const auto report = repair_archive(path, fixed);
  EXPECT_TRUE(report->saved_all());
  EXPECT_TRUE(verify_archive(fixed)->ok());
}

/// What is read is what was committed, or an error.
void expect_nothing_false(const MapArchive& archive, const Contents& then) {
  EXPECT_EQ(archive.tiles().size(), then.size());
  for (const TileRecord& t : archive.tiles()) {
    Bytes joined;
    bool good = true;
    for (const SegmentRef& s : t.segments) {
      const auto segment = archive.read(s);
      good = good && segment.ok();
      if (segment.ok()) joined.insert(joined.end(), segment->begin(), segment->end());
    }
    if (good) {
      EXPECT_EQ(joined, then.at(tile_name(t)));
    }
  }
}

TEST(MapRepair, EveryFlippedByteOfASmallArchive) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_small(path);
  const Bytes whole = read_file(path);
  std::map<std::uint64_t, Contents> history;
  for (std::uint64_t r = 1; r <= 3; ++r) history[r] = contents(*MapArchive::open(path, r));
  std::size_t corrected = 0;
  for (std::size_t at = 0; at < 3 * whole.size(); ++at) {
    SCOPED_TRACE(at / 3);
    Bytes bytes = whole;
    bytes[at / 3] ^= at % 3 == 0 ? 1 : at % 3 == 1 ? 0x80 : 0xFF;
    if (const auto archive = open_bytes(bytes); archive.ok()) {
      expect_nothing_false(*archive, history[archive->revision()]);
      EXPECT_FALSE(archive->verify()->ok());
      EXPECT_FALSE(archive->verify()->only_unfinished());
      // A writer goes on from the last revision or refuses: it never cuts a commit off.
      const bool newest = archive->revision() == 3;
      EXPECT_EQ(archive->lost_newest(), !newest);
      EXPECT_EQ(MapWriter::open(std::make_unique<MemoryStore>(bytes)).ok(), newest);
    }
    MemoryStore fixed;
    const auto report = repair_archive(MemoryStore(bytes), fixed);
    ASSERT_TRUE(report.ok()) << report.error().to_string();
    // A wrong byte of an index, of facts or of a record is corrected; one in a tile costs that tile.
    EXPECT_EQ(report->saved_all(), report->lost.empty());
    EXPECT_EQ(report->lost.empty(), report->corrected.size() == 1);
    EXPECT_LE(report->lost.size(), 2u);  // a base that two versions share
    EXPECT_EQ(report->revision, 3u);
    const auto archive = open_bytes(fixed.bytes());
    ASSERT_TRUE(archive.ok());
    EXPECT_TRUE(archive->verify()->ok());
    Contents then = history[3];
    for (const LostTile& t : report->lost) {
      const std::string name = tile_name({t.key, t.submap, 0, 0, {}, {}, {}, {}});
      if (t.saved_revision > 0) {
        then[name] = history[t.saved_revision].at(name);
      } else if (archive->tiles().size() < then.size()) {
        then.erase(name);
      }
    }
    EXPECT_EQ(contents(*archive), then);
    corrected += report->saved_all() ? 1 : 0;
  }
  EXPECT_GT(corrected, 2500u);
}

TEST(MapRepair, AnOlderVersionStandsInForADamagedTile) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(20, info, 1);
  write_map(path, info, tiles);
  auto writer = MapWriter::open(path);
  ASSERT_TRUE(writer->extend(tiles[5].key, 9, tiles[5].bounds, tiles[5].errors, Bytes{1, 2, 3, 4}).ok());
  ASSERT_TRUE(writer->remove(tiles[6].key).ok());
  ASSERT_TRUE(writer->commit(2).ok());
  std::mt19937_64 random(3);
  add_tile(*writer, random_tile(tiles[6].key, info, random));
  ASSERT_TRUE(writer->commit(3).ok());
  Bytes bytes = read_file(path);
  bytes[writer->find(tiles[5].key)->segments[1].offset] ^= 1;  // its base is whole
  bytes[writer->find(tiles[6].key)->segments[0].offset] ^= 1;  // its older version was removed meanwhile
  MemoryStore fixed;
  const auto report = repair_archive(MemoryStore(bytes), fixed);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  ASSERT_EQ(report->lost.size(), 2u);
  EXPECT_EQ(report->lost[0].key, tiles[5].key);
  EXPECT_EQ(report->lost[0].saved_revision, 1u);
  EXPECT_EQ(report->lost[1].key, tiles[6].key);
  EXPECT_EQ(report->lost[1].saved_revision, 0u);
  const auto archive = open_bytes(fixed.bytes());
  EXPECT_EQ(archive->tiles().size(), 19u);
  expect_same(*archive, archive->tiles()[*archive->find(tiles[5].key)], tiles[5]);
  EXPECT_TRUE(archive->verify()->ok());
}

TEST(MapRepair, WithoutItsFirstIndexTheChangesAreSaved) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), fixed = folder.path("f.mapc");
  const MapInfo info = sample_info();
  write_map(path, info, random_tiles(100, info, 1));
  const std::size_t first_record = read_file(path).size() - 32;
  std::mt19937_64 random(2);
  const SampleTile added = random_tile({50, 50, 50, 0}, info, random);
  {
    auto writer = MapWriter::open(path);
    add_tile(*writer, added);
    MapInfo changed = info;
    changed.flags = 1;  // so that the commit has its own facts
    ASSERT_TRUE(writer->set_info(changed).ok());
    ASSERT_TRUE(writer->commit(5).ok());
  }
  Bytes bytes = read_file(path);
  bytes[first_record - 200] ^= 4;
  bytes[first_record - 300] ^= 4;  // one alone would be corrected
  write_file(path, bytes);
  EXPECT_EQ(MapArchive::open(path).error().code, ErrorCode::kArchiveDamaged);
  const auto report = repair_archive(path, fixed);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_FALSE(report->saved_all());
  EXPECT_EQ(report->tiles_saved, 1u);
  EXPECT_NE(report->notes.back().find("100 tiles"), std::string::npos) << report->notes.back();
  const auto archive = MapArchive::open(fixed);
  ASSERT_TRUE(archive.ok());
  expect_same(*archive, archive->tiles()[0], added);
}

TEST(MapRepair, WhatCannotBeSavedSaysSo) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), fixed = folder.path("f.mapc");
  write_small(path);
  Bytes bytes = read_file(path);
  bytes[6] = 9;  // a newer format would sign its commits with its own header: this one is damaged
  write_file(path, bytes);
  EXPECT_EQ(MapArchive::open(path).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(repair_archive(path, fixed)->corrected.at(0), "the header");
  write_file(path, ByteSpan(bytes).first(100));
  EXPECT_EQ(repair_archive(path, folder.path("g")).error().code, ErrorCode::kUnsupported);
  bytes[6] = 0;
  write_file(path, ByteSpan(bytes).first(100));
  EXPECT_EQ(repair_archive(path, folder.path("g")).error().code, ErrorCode::kArchiveDamaged);
  write_file(path, {});
  EXPECT_EQ(repair_archive(path, folder.path("g")).error().code, ErrorCode::kEmpty);
  write_file(path, random_bytes(5000, 1));
  EXPECT_EQ(repair_archive(path, folder.path("g")).error().code, ErrorCode::kMalformed);
  EXPECT_FALSE(std::filesystem::exists(folder.path("g")));
}

}  // namespace
}  // namespace mapcodec
