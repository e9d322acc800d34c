// SPDX-License-Identifier: GPL-3.0-or-later
// Snapshots, rollback, differences, compaction, content hashes.
#include <atomic>
#include <thread>

#include "maps/compaction.hpp"
#include "maps/map_changes.hpp"
#include "tests/unit/maps_support.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

/// Ten revisions of random changes; the fourth has a name. Tile 0 is never touched.
void write_history(const std::string& path, std::size_t tiles = 60, bool hashes = false) {
  const MapInfo info = sample_info();
  const auto all = random_tiles(tiles, info, 1);
  auto writer = MapWriter::create(path, info, true);
  ASSERT_TRUE(writer.ok());
  writer->store_hashes(hashes);
  for (const SampleTile& t : all) add_tile(*writer, t);
  ASSERT_TRUE(writer->commit(1000).ok());
  std::mt19937_64 random(7);
  for (int round = 2; round <= 10; ++round) {
    for (int i = 0; i < 5; ++i)
      add_tile(*writer, random_tile(all[1 + random() % (tiles - 1)].key, info, random));
    const SampleTile& extended = all[1 + random() % (tiles - 1)];
    if (writer->find(extended.key)) {
      ASSERT_TRUE(
          writer->extend(extended.key, 5, extended.bounds, extended.errors, random_bytes(9, random())).ok());
    }
    const TileKey gone = all[1 + random() % (tiles - 1)].key;
    if (writer->find(gone)) {
      ASSERT_TRUE(writer->remove(gone).ok());
    }
    if (round == 5) {
      ASSERT_TRUE(writer->add_snapshot("fourth").ok());
    }
    ASSERT_TRUE(writer->commit(1000 + round).ok());
  }
}

/// Everything a reader sees of a revision but where it lies.
std::vector<std::string> contents(const MapArchive& archive) {
  std::vector<std::string> lines;
  for (const TileRecord& t : archive.tiles()) {
    const auto hash = archive.hash(t);
    EXPECT_TRUE(hash.ok()) << hash.error().to_string();
    lines.push_back(tile_name(t) + " " + std::to_string(t.points) + " " + std::to_string(t.segments.size()) +
                    " " + hash->to_string());
  }
  return lines;
}

std::vector<std::string> contents(const std::string& path, std::uint64_t revision) {
  const auto archive = MapArchive::open(path, revision);
  EXPECT_TRUE(archive.ok());
  return contents(*archive);
}

void expect_sound(const std::string& path) {
  const auto report = verify_archive(path);
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(report->ok()) << report->findings[0].to_string();
}

TEST(MapHistory, RollbackRestoresTilesAndFactsAndWritesNoTile) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  const auto then = contents(path, 3), now = contents(path, 10);
  const std::size_t before = read_file(path).size();
  {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer.ok());
    EXPECT_EQ(writer->restore(11).error().code, ErrorCode::kNotFound);
    EXPECT_EQ(writer->restore(0).error().code, ErrorCode::kNotFound);
    ASSERT_TRUE(writer->restore(3).ok());
    EXPECT_EQ(writer->restore(3).error().code, ErrorCode::kInvalidArgument);  // not committed
    ASSERT_EQ(writer->commit(2000).value(), 11u);
  }
  EXPECT_EQ(contents(path, 11), then);
  EXPECT_EQ(contents(path, 10), now);
  EXPECT_LT(read_file(path).size(), before + 2500);
  const auto archive = MapArchive::open(path);
  EXPECT_EQ(archive->info().input_points, sample_info().input_points);
  ASSERT_EQ(archive->info().snapshots.size(), 1u);  // names stay
  expect_sound(path);
  {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer->restore(10).ok());
    ASSERT_EQ(writer->commit(2001).value(), 12u);
  }
  EXPECT_EQ(contents(path, 12), now);
  expect_sound(path);
}

TEST(MapHistory, SnapshotNames) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  auto writer = MapWriter::open(path);
  for (const std::string& bad : {std::string(), std::string("12"), std::string("a\nb"), std::string("fourth"),
                                 std::string(256, 'x'), std::string("\x1b[2J"), std::string("a\0b", 3)}) {
    EXPECT_EQ(writer->add_snapshot(bad).error().code, ErrorCode::kInvalidArgument) << bad;
  }
  ASSERT_TRUE(writer->add_snapshot("../../etc/passwd").ok());  // a name, never a path
  ASSERT_TRUE(writer->add_snapshot("Montag früh").ok());
  EXPECT_EQ(writer->remove_snapshot("none").error().code, ErrorCode::kNotFound);
  ASSERT_EQ(writer->commit(1).value(), 11u);
  const auto archive = MapArchive::open(path);
  EXPECT_EQ(archive->resolve("fourth").value(), 4u);
  EXPECT_EQ(archive->resolve("Montag früh").value(), 10u);
  EXPECT_EQ(archive->resolve("7").value(), 7u);
  for (const char* bad : {"", "-1", "1x", " 1", "99999999999", "nobody"})
    EXPECT_EQ(archive->resolve(bad).error().code, ErrorCode::kNotFound) << bad;
  EXPECT_NE(archive->resolve("nobody").error().message.find("fourth"), std::string::npos);
  auto fresh = MapWriter::create(folder.path("n.mapc"), sample_info(), false);
  EXPECT_EQ(fresh->add_snapshot("x").error().code, ErrorCode::kInvalidArgument);  // nothing to name
}

TEST(MapHistory, DifferencesByContent) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), other = folder.path("n.mapc");
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(30, info, 1);
  write_map(path, info, tiles);
  std::mt19937_64 random(2);
  const SampleTile added = random_tile({50, 50, 50, 0}, info, random),
                   changed = random_tile(tiles[4].key, info, random);
  {
    auto writer = MapWriter::open(path);
    add_tile(*writer, added);
    add_tile(*writer, changed);
    add_tile(*writer, tiles[5]);  // the same bytes again: elsewhere, but no change
    ASSERT_TRUE(writer->remove(tiles[6].key).ok());
    ASSERT_TRUE(writer->commit(1).ok());
  }
  const auto now = MapArchive::open(path);
  const auto changes = changes_since(*now, 1);
  ASSERT_TRUE(changes.ok()) << changes.error().to_string();
  ASSERT_EQ(changes->size(), 3u);
  std::map<TileKey, TileChange, MortonLess> by_key;
  for (const TileChange& c : *changes) by_key[c.key] = c;
  EXPECT_EQ(by_key[added.key].kind, ChangeKind::added);
  EXPECT_EQ(by_key[added.key].hash, hash_tile(2, {hash_bytes(added.bytes)}));
  EXPECT_EQ(by_key[added.key].bytes_after, added.bytes.size());
  EXPECT_EQ(by_key[changed.key].kind, ChangeKind::changed);
  EXPECT_EQ(by_key[changed.key].points_before, tiles[4].points);
  EXPECT_EQ(by_key[tiles[6].key].kind, ChangeKind::removed);
  EXPECT_FALSE(by_key[tiles[6].key].tile);
  EXPECT_EQ(changes_since(*now, 2)->size(), 0u);
  EXPECT_EQ(changes_since(*now, 0)->size(), now->tiles().size());
  EXPECT_EQ(changes_since(*now, 3).error().code, ErrorCode::kInvalidArgument);

  // Another archive of the same content, written otherwise: equal hashes.
  auto writer = MapWriter::create(other, info, false);
  for (auto t = tiles.rbegin(); t != tiles.rend(); ++t) {
    if (t->key != tiles[4].key && t->key != tiles[6].key) add_tile(*writer, *t);
  }
  add_tile(*writer, changed);
  add_tile(*writer, added);
  ASSERT_TRUE(writer->commit(9).ok());
  const auto twin = MapArchive::open(other);
  EXPECT_FALSE(now->shares_store(*twin));
  EXPECT_TRUE(diff_maps(*now, *twin, true)->empty());
  EXPECT_EQ(contents(*now), contents(*twin));
  std::set<ContentHash> have;
  for (const TileRecord& t : twin->tiles()) have.insert(*twin->hash(t));
  EXPECT_TRUE(missing_tiles(*now, have)->empty());
  EXPECT_EQ(missing_tiles(*MapArchive::open(path, 1), have)->size(), 2u);  // the old tiles 4 and 6
  EXPECT_EQ(missing_tiles(*now, {})->size(), now->tiles().size());
}

TEST(MapHistory, HashOfATileTellsWhatItIsMadeOf) {
  const ContentHash a = hash_bytes(Bytes{1}), b = hash_bytes(Bytes{2});
  EXPECT_EQ(hash_bytes({}).to_string(),
            "99aa06d3014798d86001c324468d497f");  // XXH3-128 of nothing, published
  EXPECT_NE(hash_tile(1, {a}), hash_tile(2, {a}));
  EXPECT_NE(hash_tile(1, {a, b}), hash_tile(1, {b, a}));
  EXPECT_NE(hash_tile(1, {a}), hash_tile(1, {a, a}));
}

TEST(MapHistory, StoredHashesAreKeptAndRight) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), plain = folder.path("n.mapc");
  write_history(path, 60, true);
  write_history(plain, 60, false);
  EXPECT_EQ(contents(path, 10), contents(plain, 10));
  for (const std::uint64_t revision : {1u, 4u, 10u}) {
    const auto archive = MapArchive::open(path, revision), bare = MapArchive::open(plain, revision);
    const std::uint64_t opened = archive->bytes_read();
    for (std::size_t i = 0; i < archive->tiles().size(); ++i) {
      EXPECT_EQ(archive->tiles()[i].hashes.size(), archive->tiles()[i].segments.size());
      EXPECT_TRUE(bare->tiles()[i].hashes.empty());
      EXPECT_EQ(*archive->hash(archive->tiles()[i]), *bare->hash(bare->tiles()[i]));
    }
    EXPECT_EQ(archive->bytes_read(), opened);  // nothing was read for them
  }
  // Without being asked, a later writer goes on storing them, also in a full index.
  for (int i = 0; i < 30; ++i) {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer->add({i, 99, 0, 0}, 1, 1, {}, {}, Bytes{1}).ok());
    ASSERT_TRUE(writer->commit(i).ok());
  }
  const auto archive = MapArchive::open(path);
  for (const TileRecord& t : archive->tiles()) EXPECT_FALSE(t.hashes.empty());
  expect_sound(path);
}

TEST(MapHistory, CompactionKeepsWhatIsNamedAndReclaimsTheRest) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  const auto fourth = contents(path, 4), last = contents(path, 10);
  const Bytes old_file = read_file(path);
  const auto reader = MapArchive::open(path);  // has the old file open
  const auto report = compact_archive(path);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  const Bytes once = read_file(path);
  EXPECT_EQ(report->bytes_before, old_file.size());
  EXPECT_EQ(report->bytes_after, once.size());
  EXPECT_LT(once.size(), old_file.size());
  EXPECT_EQ(report->revisions_before, 10u);
  EXPECT_EQ(report->revisions_after, 2u);
  EXPECT_EQ(folder.files(), 1u);
  expect_sound(path);
  const auto archive = MapArchive::open(path);
  const auto log = archive->log();
  ASSERT_EQ(log->size(), 2u);
  EXPECT_EQ((*log)[0].revision, 10u);
  EXPECT_EQ((*log)[0].timestamp_s, 1010);
  EXPECT_EQ((*log)[1].revision, 4u);
  EXPECT_EQ((*log)[1].timestamp_s, 1004);
  EXPECT_EQ(contents(*archive), last);
  EXPECT_EQ(contents(path, 4), fourth);
  EXPECT_EQ(MapArchive::open(path, 3).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(archive->info().input_points, sample_info().input_points);
  EXPECT_EQ(verify_archive(path)->dead_bytes > 0, true);  // what only the fourth has

  EXPECT_EQ(contents(*reader), last);  // undisturbed
  EXPECT_EQ(reader->at(2)->revision(), 2u);
  EXPECT_TRUE(reader->verify()->ok());
  EXPECT_TRUE(diff_maps(*reader, *archive, false)->empty());

  ASSERT_TRUE(compact_archive(path).ok());
  EXPECT_EQ(read_file(path), once);  // byte for byte
  {
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer->remove_snapshot("fourth").ok());
    ASSERT_EQ(writer->commit(3000).value(), 11u);  // numbers go on
  }
  ASSERT_TRUE(compact_archive(path).ok());
  EXPECT_EQ(MapArchive::open(path)->log()->size(), 1u);
  EXPECT_EQ(contents(path, 11), last);
  EXPECT_EQ(verify_archive(path)->dead_bytes, 0u);
}

TEST(MapHistory, CompactionIsIdempotentForManySettings) {
  for (const std::uint64_t keep : {1u, 3u, 100u}) {
    for (const bool hashes : {false, true}) {
      TemporaryFolder folder;
      const std::string path = folder.path("m.mapc");
      write_history(path, 40 + 10 * keep % 31);
      CompactSettings settings;
      settings.keep_last = keep;
      settings.hashes = hashes;
      const auto report = compact_archive(path, settings);
      ASSERT_TRUE(report.ok()) << report.error().to_string();
      EXPECT_EQ(report->revisions_after, std::min<std::uint64_t>(keep == 100 ? 10 : keep + 1, 10));
      const Bytes once = read_file(path);
      ASSERT_TRUE(compact_archive(path, settings).ok());
      EXPECT_EQ(read_file(path), once);
      settings.hashes.reset();  // as it is
      ASSERT_TRUE(compact_archive(path, settings).ok());
      EXPECT_EQ(read_file(path), once);
      expect_sound(path);
      const auto archive = MapArchive::open(path);
      for (const TileRecord& t : archive->tiles()) EXPECT_EQ(t.hashes.empty(), !hashes);
    }
  }
}

/// Joins the segments; the sum of their bytes stands for the points.
Result<std::optional<FoldedTile>> join(const MapInfo&, const TileRecord& tile,
                                       const std::vector<Bytes>& segments) {
  FoldedTile folded{tile.codec, 0, tile.bounds, tile.errors, {}};
  for (const Bytes& s : segments) folded.bytes.insert(folded.bytes.end(), s.begin(), s.end());
  folded.points = folded.bytes.size();
  return std::optional(folded);
}

TEST(MapHistory, CompactionFolds) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  const auto before = MapArchive::open(path);
  std::uint64_t deltas = 0;
  for (const TileRecord& t : before->tiles()) deltas += t.segments.size() > 1 ? 1 : 0;
  ASSERT_GT(deltas, 0u);
  CompactSettings settings;
  settings.fold = join;
  const auto report = compact_archive(path, settings);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_GE(report->folded_tiles, deltas);
  const auto after = MapArchive::open(path);
  ASSERT_EQ(after->tiles().size(), before->tiles().size());
  for (std::size_t i = 0; i < after->tiles().size(); ++i) {
    const TileRecord &a = before->tiles()[i], &b = after->tiles()[i];
    ASSERT_EQ(b.segments.size(), 1u);
    Bytes joined;
    for (const SegmentRef& s : a.segments) {
      const auto bytes = before->read(s);
      joined.insert(joined.end(), bytes->begin(), bytes->end());
    }
    EXPECT_EQ(*after->read(b.segments[0]), joined);
    EXPECT_EQ(b.points, a.segments.size() > 1 ? joined.size() : a.points);
  }
  const Bytes once = read_file(path);
  EXPECT_EQ(compact_archive(path, settings)->folded_tiles, 0u);
  EXPECT_EQ(read_file(path), once);
  expect_sound(path);
}

TEST(MapHistory, AFailedCompactionLeavesTheArchive) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  const Bytes before = read_file(path);
  CompactSettings settings;
  int tiles = 0;
  settings.stop = [&tiles] { return ++tiles > 20; };
  EXPECT_EQ(compact_archive(path, settings).error().code, ErrorCode::kCancelled);
  settings.stop = {};
  settings.fold = [](const MapInfo&, const TileRecord&, const std::vector<Bytes>&) {
    return Result<std::optional<FoldedTile>>(make_error(ErrorCode::kMalformed, "no"));
  };
  EXPECT_EQ(compact_archive(path, settings).error().code, ErrorCode::kMalformed);
  settings.fold = [](const MapInfo&, const TileRecord&, const std::vector<Bytes>&) {
    return Result<std::optional<FoldedTile>>(std::optional(FoldedTile()));  // no byte
  };
  EXPECT_EQ(compact_archive(path, settings).error().code, ErrorCode::kInvalidArgument);
  {
    const auto writer = MapWriter::open(path);
    EXPECT_EQ(compact_archive(path).error().code, ErrorCode::kCannotWrite);
  }
  EXPECT_EQ(compact_archive(folder.path("none")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(compact_archive("/dev/null").error().code, ErrorCode::kUnreadable);
  EXPECT_EQ(read_file(path), before);
  EXPECT_EQ(folder.files(), 1u);
  write_file(folder.path("text"), Bytes{'h', 'e', 'l', 'l', 'o', ' ', 'w', 'o', 'r', 'l', 'd'});
  EXPECT_EQ(compact_archive(folder.path("text")).error().code, ErrorCode::kMalformed);

  Bytes damaged = before;
  damaged[20] ^= 1;  // in a tile
  write_file(path, damaged);
  EXPECT_EQ(compact_archive(path).error().code, ErrorCode::kChecksumMismatch);
  EXPECT_EQ(read_file(path), damaged);
}

TEST(MapHistory, CompactionFollowsLinksAndKeepsPermissions) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc"), link = folder.path("link.mapc");
  write_history(path);
  std::filesystem::permissions(path, std::filesystem::perms(0640));
  std::filesystem::create_symlink("m.mapc", link);
  const auto before = read_file(path).size();
  ASSERT_TRUE(compact_archive(link).ok());
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_LT(read_file(path).size(), before);
  EXPECT_EQ(std::filesystem::status(path).permissions(), std::filesystem::perms(0640));
}

TEST(MapHistory, ARemovedArchiveStaysReadableWhereItIsOpen) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  const auto reader = MapArchive::open(path);
  const auto before = contents(*reader);
  std::filesystem::remove(path);
  EXPECT_EQ(contents(*reader), before);
  EXPECT_EQ(MapArchive::open(path).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(MapWriter::open(path).error().code, ErrorCode::kNotFound);
  // Cut under a reader: an error that says so, never zeros.
  write_history(path);
  const auto cut = MapArchive::open(path);
  write_file(path, Bytes{1, 2, 3});
  EXPECT_EQ(cut->read(cut->tiles()[0].segments[0]).error().code, ErrorCode::kArchiveDamaged);
  EXPECT_FALSE(cut->verify()->ok());
}

TEST(MapHistory, ReadersGoOnWhileAWriterCommitsAndCompacts) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(30, info, 1, 3000);
  write_map(path, info, tiles);
  std::atomic<bool> done{false};
  std::atomic<int> reads{0};
  const auto read = [&] {
    for (std::uint64_t newest = 0; !done;) {
      const auto archive = MapArchive::open(path);
      ASSERT_TRUE(archive.ok()) << archive.error().to_string();
      EXPECT_GE(archive->revision(), newest);  // never back
      newest = archive->revision();
      ASSERT_EQ(archive->tiles().size(), 30u);
      std::set<std::uint64_t> stamps;
      for (const TileRecord& t : archive->tiles()) {
        for (const SegmentRef& s : t.segments) {
          ASSERT_TRUE(archive->read(s).ok());
        }
        stamps.insert(t.points);
      }
      // Every commit changes all tiles or none: a mixture would be half a commit.
      EXPECT_TRUE(stamps.size() == 1 || newest == 1);
      ++reads;
    }
  };
  std::thread one(read), two(read);
  for (int round = 0; round < 60 || reads < 20; ++round) {
    {
      auto writer = MapWriter::open(path);
      ASSERT_TRUE(writer.ok()) << writer.error().to_string();
      for (const SampleTile& t : tiles) {
        const Bytes bytes = random_bytes(t.bytes.size(), static_cast<std::uint64_t>(round));
        const auto points = static_cast<std::uint64_t>(round + 2);
        ASSERT_TRUE(writer->add(t.key, 2, points, t.bounds, t.errors, bytes).ok());
      }
      ASSERT_TRUE(writer->commit(round).ok());
    }
    if (round % 3 == 0) {
      ASSERT_TRUE(compact_archive(path).ok());
    }
  }
  done = true;
  one.join();
  two.join();
  expect_sound(path);
}

TEST(MapHistory, TwoWritersAndTwoCompactionsExcludeOneAnother) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_history(path);
  std::atomic<int> compacted{0}, committed{0};
  const auto work = [&](int first) {
    for (int i = 0; i < 40; ++i) {
      if ((i + first) % 2 == 0) {
        const auto report = compact_archive(path);
        if (!report.ok()) {
          EXPECT_EQ(report.error().code, ErrorCode::kCannotWrite) << report.error().to_string();
        }
        compacted += report.ok() ? 1 : 0;
        continue;
      }
      auto writer = MapWriter::open(path);
      if (!writer.ok()) {
        EXPECT_EQ(writer.error().code, ErrorCode::kCannotWrite) << writer.error().to_string();
        continue;
      }
      ASSERT_TRUE(writer->add({i, first, 77, 0}, 1, 1, {}, {}, Bytes{1}).ok());
      ASSERT_TRUE(writer->commit(i).ok());
      ++committed;
    }
  };
  std::thread one(work, 0), two(work, 1);
  one.join();
  two.join();
  expect_sound(path);
  EXPECT_EQ(MapArchive::open(path)->revision(),
            10u + static_cast<unsigned>(committed.load()));  // none was lost
  EXPECT_EQ(folder.files(), 1u);
}

}  // namespace
}  // namespace mapcodec
