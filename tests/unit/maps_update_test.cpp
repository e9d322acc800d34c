// SPDX-License-Identifier: GPL-3.0-or-later
// Revisions: what a second commit changes, and what it leaves.
#include "tests/unit/maps_support.hpp"

#include <map>
#include <thread>

#include "maps/commit_record.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

TEST(MapWriter, AddsReplacesExtendsAndRemoves) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(200, info, 1);
  write_map(path, info, tiles);
  const Bytes before = read_file(path);
  std::mt19937_64 random(2);
  const SampleTile replaced = random_tile(tiles[5].key, info, random),
                   added = random_tile({50, 50, 50, 0}, info, random);
  {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer.ok()) << writer.error().to_string();
    add_tile(*writer, random_tile(tiles[5].key, info, random));  // replaced again below: a dead range
    add_tile(*writer, replaced);
    add_tile(*writer, added);
    ASSERT_TRUE(writer->remove(tiles[7].key).ok());
    EXPECT_EQ(writer->remove(tiles[7].key).error().code, ErrorCode::kNotFound);
    add_tile(*writer, random_tile({60, 0, 0, 0}, info, random));
    ASSERT_TRUE(writer->remove({60, 0, 0, 0}).ok());  // never seen by anyone
    ASSERT_TRUE(writer->extend(tiles[9].key, 77, tiles[9].bounds, tiles[9].errors, Bytes{9, 9, 9}).ok());
    EXPECT_EQ(writer->extend({70, 0, 0, 0}, 1, {}, {}, Bytes{1}).error().code, ErrorCode::kNotFound);
    const auto revision = writer->commit(1'700'000'100);
    ASSERT_TRUE(revision.ok()) << revision.error().to_string();
    EXPECT_EQ(*revision, 2u);
  }
  const Bytes after = read_file(path);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), after.begin()));  // append-only
  EXPECT_LT(after.size(), before.size() + 2500);                         // a delta, not the whole index

  const auto now = MapArchive::open(path), then = MapArchive::open(path, 1);
  ASSERT_TRUE(now.ok() && then.ok());
  EXPECT_EQ(now->revision(), 2u);
  EXPECT_EQ(now->tiles().size(), 200u);
  expect_same(*now, now->tiles()[*now->find(replaced.key)], replaced);
  expect_same(*now, now->tiles()[*now->find(added.key)], added);
  EXPECT_FALSE(now->find(tiles[7].key));
  EXPECT_FALSE(now->find({60, 0, 0, 0}));
  const TileRecord& extended = now->tiles()[*now->find(tiles[9].key)];
  ASSERT_EQ(extended.segments.size(), 2u);
  EXPECT_EQ(extended.points, 77u);
  EXPECT_EQ(*now->read(extended.segments[0]), tiles[9].bytes);
  EXPECT_EQ(*now->read(extended.segments[1]), (Bytes{9, 9, 9}));
  for (std::size_t i = 0; i < tiles.size(); ++i) expect_same(*then, then->tiles()[i], tiles[i]);

  const auto report = now->verify();
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(report->ok()) << report->findings[0].to_string();
  EXPECT_EQ(report->checked_bytes, after.size());
  EXPECT_EQ(report->revisions, 2u);
  EXPECT_GT(report->dead_bytes, 0u);
  const auto log = now->log();
  ASSERT_TRUE(log.ok());
  ASSERT_EQ(log->size(), 2u);
  EXPECT_EQ((*log)[0].timestamp_s, 1'700'000'100);
  EXPECT_EQ((*log)[1].tiles, 200u);
  EXPECT_EQ((*log)[1].bytes, before.size() - kHeaderBytes);
  EXPECT_EQ(MapArchive::open(path, 3).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(MapArchive::open(path, 0).error().code, ErrorCode::kNotFound);
}

/// What a map should hold, kept beside the archive.
using Model = std::map<TileKey, SampleTile, MortonLess>;

void expect_model(const MapArchive& archive, const Model& model) {
  ASSERT_EQ(archive.tiles().size(), model.size());
  std::size_t i = 0;
  for (const auto& [key, tile] : model) expect_same(archive, archive.tiles()[i++], tile);
}

TEST(MapWriter, ManyRevisionsEqualAModel) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  std::mt19937_64 random(11);
  Model model;
  for (const SampleTile& t : random_tiles(60, info, 1)) model[t.key] = t;
  std::vector<SampleTile> first;
  for (const auto& [key, tile] : model) first.push_back(tile);
  write_map(path, info, first);
  std::map<std::uint64_t, Model> history{{1, model}};
  for (int round = 0; round < 60; ++round) {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer.ok()) << writer.error().to_string();
    for (int change = 0; change < 4; ++change) {
      const TileKey key{static_cast<int>(random() % 4), static_cast<int>(random() % 4),
                        static_cast<int>(random() % 4), 0};
      if (random() % 3 == 0 && model.erase(key) > 0) {
        ASSERT_TRUE(writer->remove(key).ok());
      } else {
        model[key] = random_tile(key, info, random);
        add_tile(*writer, model[key]);
      }
    }
    const auto revision = writer->commit(1'700'000'000 + round);
    ASSERT_TRUE(revision.ok());
    history[*revision] = model;
  }
  for (const auto& [revision, expected] : history) {
    const auto archive = MapArchive::open(path, revision);
    ASSERT_TRUE(archive.ok()) << archive.error().to_string();
    EXPECT_EQ(archive->info().input_points, info.input_points);
    expect_model(*archive, expected);
  }
  const auto report = MapArchive::open(path)->verify();
  EXPECT_TRUE(report->ok()) << report->findings[0].to_string();
  EXPECT_EQ(report->revisions, 61u);
}

TEST(MapWriter, BoundsAndErrorsDoNotDrift) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  write_map(path, info, random_tiles(50, info, 1));
  const auto first = MapArchive::open(path);
  for (int round = 0; round < 20;
       ++round) {  // each replaces a tile and now and then rewrites the whole index
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer->set_info(writer->info()).ok());
    for (int i = 0; i < 10; ++i) {
      const TileRecord& t = first->tiles()[static_cast<std::size_t>(i)];
      ASSERT_TRUE(writer->add(t.key, t.codec, t.points, t.bounds, t.errors, Bytes{1, 2}).ok());
    }
    ASSERT_TRUE(writer->commit(0).ok());
  }
  const auto last = MapArchive::open(path), early = MapArchive::open(path, 6);
  ASSERT_TRUE(last.ok() && early.ok());
  for (std::size_t i = 0; i < 50; ++i) {
    EXPECT_EQ(last->tiles()[i].bounds.min, first->tiles()[i].bounds.min);
    EXPECT_EQ(last->tiles()[i].bounds.max, first->tiles()[i].bounds.max);
    EXPECT_EQ(last->tiles()[i].errors.rms_m, early->tiles()[i].errors.rms_m);
    EXPECT_GE(last->tiles()[i].errors.rms_m, first->tiles()[i].errors.rms_m);
    EXPECT_LE(last->tiles()[i].errors.rms_m, first->tiles()[i].errors.rms_m + 0.003 / 32);
  }
  EXPECT_EQ(last->info().bounds.min, first->info().bounds.min);
  EXPECT_EQ(last->info().bounds.max, first->info().bounds.max);
  EXPECT_EQ(last->info().achieved.rms_m, first->info().achieved.rms_m);
}

TEST(MapWriter, SmallCommitsStaySmallAndChainsShort) {
  auto store = std::make_unique<MemoryStore>();
  const MemoryStore& memory = *store;
  const MapInfo info = sample_info();
  auto writer = MapWriter::create(std::move(store), info);
  for (const SampleTile& t : random_tiles(2000, info, 1, 20)) add_tile(*writer, t);
  ASSERT_TRUE(writer->commit(0).ok());
  const std::size_t first = memory.bytes().size();
  for (int i = 0; i < 600; ++i) {
    ASSERT_TRUE(
        writer->add({i, 0, 0, 0}, 1, 1, tile_cube({i, 0, 0, 0}, info.origin, info.tile_size_m), {}, Bytes{1})
            .ok());
    ASSERT_TRUE(writer->commit(i).ok());
  }
  EXPECT_LT(memory.bytes().size(), first + 600 * 140 + 6 * 34000);
  const auto archive = open_bytes(memory.bytes());
  ASSERT_TRUE(archive.ok()) << archive.error().to_string();
  EXPECT_EQ(archive->revision(), 601u);
  EXPECT_LT(archive->bytes_read(), 200000u);
  EXPECT_TRUE(archive->verify()->ok());
}

TEST(MapWriter, EmptyCommitAndLaterCommits) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  MapInfo info = sample_info();
  auto writer = MapWriter::create(path, info, false);
  ASSERT_TRUE(writer.ok());
  ASSERT_EQ(writer->commit(5).value(), 1u);
  EXPECT_TRUE(MapArchive::open(path)->tiles().empty());
  ASSERT_EQ(writer->commit(6).value(), 2u);
  info.snapshots.push_back({"kept", 1});
  ASSERT_TRUE(writer->set_info(info).ok());
  ASSERT_EQ(writer->commit(7).value(), 3u);
  EXPECT_EQ(MapArchive::open(path)->info().snapshots.size(), 1u);
  EXPECT_TRUE(MapArchive::open(path, 2)->info().snapshots.empty());
  info.tile_size_m *= 2;
  EXPECT_EQ(writer->set_info(info).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->commit(-1).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->commit(std::int64_t{1} << 40).error().code, ErrorCode::kInvalidArgument);
  ASSERT_EQ(writer->commit((std::int64_t{1} << 40) - 1).value(), 4u);
  EXPECT_TRUE(MapArchive::open(path)->verify()->ok());
}

TEST(MapWriter, RefusesBadArguments) {
  MapInfo info = sample_info();
  const auto refused = [](const MapInfo& i) {
    const auto writer = MapWriter::create(std::make_unique<MemoryStore>(), i);
    return !writer.ok() && writer.error().code == ErrorCode::kInvalidArgument;
  };
  info.tile_size_m = 0;
  EXPECT_TRUE(refused(info));
  info.tile_size_m = NAN;
  EXPECT_TRUE(refused(info));
  info = sample_info();
  info.origin[1] = INFINITY;
  EXPECT_TRUE(refused(info));
  info = sample_info();
  info.bounds.max[2] = INFINITY;
  EXPECT_TRUE(refused(info));
  info = sample_info();
  info.achieved.rms_m = NAN;
  EXPECT_TRUE(refused(info));
  auto writer = MapWriter::create(std::make_unique<MemoryStore>(), sample_info());
  const Bytes one{1};
  EXPECT_EQ(writer->add({}, 1, 1, {}, {}, {}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->add({}, 1, 1, {}, {NAN, 0, 0, 0}, one).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(writer->add({}, 1, 1, {{NAN, 0, 0}, {NAN, 1, 1}}, {}, one).ok(), true);  // NaN is an empty box
  EXPECT_EQ(writer->add({}, 1, 1, {{0, 0, 0}, {1, INFINITY, 1}}, {}, one).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(MapWriter, OneWriterOnly) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  write_map(path, info, random_tiles(3, info, 1));
  {
    const auto first = MapWriter::open(path);
    ASSERT_TRUE(first.ok());
    const auto second = MapWriter::open(path);
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kCannotWrite);
    EXPECT_NE(second.error().message.find("another program is writing"), std::string::npos);
    EXPECT_EQ(MapWriter::create(path, info, true).error().code, ErrorCode::kCannotWrite);
    EXPECT_TRUE(MapArchive::open(path).ok());
  }
  EXPECT_TRUE(MapWriter::open(path).ok());
}

TEST(MapWriter, CreateRefusesWhatItMustNotReplace) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_map(path, sample_info(), random_tiles(3, sample_info(), 1));
  const Bytes before = read_file(path);
  const auto again = MapWriter::create(path, sample_info(), false);
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::kCannotWrite);
  EXPECT_EQ(MapWriter::create(folder.path("no/such/folder.mapc"), sample_info(), false).error().code,
            ErrorCode::kCannotWrite);
  EXPECT_EQ(MapWriter::create("/dev/full", sample_info(), true).error().code, ErrorCode::kCannotWrite);
  EXPECT_EQ(MapWriter::create(folder.path("."), sample_info(), true).error().code, ErrorCode::kCannotWrite);
  {
    const auto dropped = MapWriter::create(path, sample_info(), true);
    ASSERT_TRUE(dropped.ok());
    EXPECT_EQ(folder.files(), 2u);
  }
  EXPECT_EQ(folder.files(), 1u);
  EXPECT_EQ(read_file(path), before);
}

TEST(MapWriter, DroppedUpdateLeavesTheArchiveAsItWas) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  write_map(path, info, random_tiles(3, info, 1));
  const Bytes before = read_file(path);
  {
    auto writer = MapWriter::open(path);
    std::mt19937_64 random(1);
    for (int i = 0; i < 10; ++i) add_tile(*writer, random_tile({i, i, i, 0}, info, random));
    EXPECT_GT(read_file(path).size(), before.size());
    EXPECT_EQ(MapArchive::open(path)->tiles().size(), 3u);
    EXPECT_GT(MapArchive::open(path)->trailing_bytes(), 0u);
    auto moved = std::move(*writer);
    EXPECT_EQ(moved.tile_count(), 13u);
  }
  EXPECT_EQ(read_file(path), before);
}

TEST(MapWriter, ReadersWhileAWriterCommits) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  write_map(path, info, random_tiles(20, info, 1));
  std::atomic<bool> stop{false};
  std::atomic<int> wrong{0}, opened{0};
  std::thread reader([&] {
    for (std::uint64_t last = 1; !stop;) {
      const auto archive = MapArchive::open(path);
      if (!archive.ok() || archive->revision() < last ||
          archive->tiles().size() != 19 + archive->revision()) {
        ++wrong;
        continue;
      }
      last = archive->revision();
      for (const TileRecord& t : archive->tiles()) wrong += archive->read(t.segments[0]).ok() ? 0 : 1;
      ++opened;
    }
  });
  auto writer = MapWriter::open(path);
  std::mt19937_64 random(3);
  for (int i = 0; i < 60 || opened < 5; ++i) {
    add_tile(*writer, random_tile({100 + i, 0, 0, 0}, info, random, 20000));
    ASSERT_TRUE(writer->commit(i).ok());
  }
  stop = true;
  reader.join();
  EXPECT_EQ(wrong, 0);
}

TEST(MapWriter, WaypointsKeepTheSearchShort) {
  auto store = std::make_unique<MemoryStore>();
  MemoryStore& memory = *store;
  const MapInfo info = sample_info();
  auto writer = MapWriter::create(std::move(store), info);
  std::mt19937_64 random(3);
  add_tile(*writer, random_tile({0, 0, 0, 0}, info, random));
  ASSERT_TRUE(writer->commit(0).ok());
  const Bytes big = random_bytes(300000, 1);
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(writer->add({i, 0, 0, 0}, 1, 1, {}, {}, big).ok());
  const auto unfinished = open_bytes(memory.bytes());
  ASSERT_TRUE(unfinished.ok()) << unfinished.error().to_string();
  EXPECT_EQ(unfinished->revision(), 1u);
  EXPECT_LT(unfinished->bytes_read(), 4000000u);  // of 18 MB that the unfinished commit has written
  ASSERT_TRUE(writer->commit(0).ok());
  const auto whole = open_bytes(memory.bytes());
  ASSERT_TRUE(whole.ok());
  EXPECT_EQ(whole->tiles().size(), 60u);
  EXPECT_TRUE(whole->verify()->ok());
}

}  // namespace
}  // namespace mapcodec
