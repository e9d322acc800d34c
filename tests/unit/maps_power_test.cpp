// SPDX-License-Identifier: GPL-3.0-or-later
// A disk that loses power: writes that were not synchronised are dropped, reordered or torn.
#include "maps/compaction.hpp"
#include "tests/unit/maps_support.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

/// What reached the disk of one file, and what may have.
struct Disk {
  struct Write {
    std::uint64_t offset = 0;
    Bytes bytes;
  };
  Bytes durable;
  std::vector<Write> pending;
  int writes_left = -1, syncs_left = -1;  // until one fails; -1: none does

  void sync() {
    for (const Write& w : pending) put(durable, w, w.bytes.size());
    pending.clear();
  }
  static void put(Bytes& image, const Write& w, std::size_t count) {
    if (image.size() < w.offset + count) image.resize(w.offset + count);
    std::copy_n(w.bytes.begin(), count, image.begin() + static_cast<std::ptrdiff_t>(w.offset));
  }
  /// After a crash now: each pending write is there, or not, or in part (from its beginning, its end, or
  /// without a sector in between), in any order; the file may have grown to any size with zeros.
  [[nodiscard]] Bytes crash(std::mt19937_64& random) const {
    Bytes image = durable;
    for (const Write& w : pending) {
      if (random() % 3 == 0) continue;
      Write part = w;
      std::size_t count = random() % 2 ? w.bytes.size() : random() % (w.bytes.size() + 1);
      if (random() % 4 == 0) {
        const std::size_t skip = random() % (count + 1);
        part = {w.offset + skip, Bytes(w.bytes.begin() + static_cast<std::ptrdiff_t>(skip), w.bytes.end())};
        count -= skip;
      }
      put(image, part, count);
    }
    if (random() % 8 == 0) image.resize(image.size() + random() % 5000);
    return image;
  }
};

/// The rules of FileStore on such a disk (FORMAT.md 3.3).
class DiskStore final : public TileStore {
 public:
  explicit DiskStore(Disk& disk) : disk_(disk), all_(disk.durable) { published_ = all_.size(); }

  Result<SegmentRef> append(ByteSpan bytes) override {
    MAPCODEC_TRY(write(bytes));
    MemoryStore one;  // for the checksum
    MAPCODEC_ASSIGN(SegmentRef ref, one.append(bytes));
    ref.offset = all_.size() - bytes.size();
    return ref;
  }
  Status publish(ByteSpan head) override {
    if (all_.size() > published_) MAPCODEC_TRY(sync());
    MAPCODEC_TRY(write(head));
    MAPCODEC_TRY(sync());
    published_ = all_.size();
    return {};
  }
  Status discard_after(std::uint64_t end) override {
    all_.resize(end);
    disk_.durable.resize(std::min<std::size_t>(disk_.durable.size(), end));
    published_ = end;
    return {};
  }
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const override {
    return MemoryStore(all_).read(offset, length);
  }
  [[nodiscard]] Result<std::uint64_t> end() const override { return std::uint64_t{all_.size()}; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return 0; }

 private:
  Error failed(const char* what) {
    broken_ = true;
    return make_error(ErrorCode::kCannotWrite, what);
  }
  Status write(ByteSpan bytes) {
    if (broken_) return failed("broken");
    if (disk_.writes_left == 0) return failed("no space");
    if (disk_.writes_left > 0) --disk_.writes_left;
    disk_.pending.push_back({all_.size(), Bytes(bytes.begin(), bytes.end())});
    all_.insert(all_.end(), bytes.begin(), bytes.end());
    return {};
  }
  Status sync() {
    if (disk_.syncs_left == 0) return failed("sync failed");
    if (disk_.syncs_left > 0) --disk_.syncs_left;
    disk_.sync();
    return {};
  }

  Disk& disk_;
  Bytes all_;  // as this process sees it
  std::uint64_t published_ = 0;
  bool broken_ = false;
};

struct Model {
  std::map<TileKey, SampleTile, MortonLess> tiles;
  std::uint64_t revision = 0;
};

void expect_model(const MapArchive& archive, const Model& model) {
  ASSERT_EQ(archive.revision(), model.revision);
  ASSERT_EQ(archive.tiles().size(), model.tiles.size());
  std::size_t i = 0;
  for (const auto& [key, tile] : model.tiles) expect_same(archive, archive.tiles()[i++], tile);
}

/// After a crash the archive is at the last committed revision, or at the one that was being committed.
void expect_survives(const Bytes& image, const Model& committed, const Model& next) {
  const auto archive = open_bytes(image);
  ASSERT_TRUE(archive.ok()) << archive.error().to_string();
  ASSERT_TRUE(archive->revision() == committed.revision || archive->revision() == next.revision);
  expect_model(*archive, archive->revision() == committed.revision ? committed : next);
  const auto report = archive->verify();
  ASSERT_TRUE(report.ok());
  for (const Error& e : report->findings)
    EXPECT_EQ(e.offset, archive->file_bytes()) << e.to_string();  // the tail
}

/// One round of changes to a writer and its model.
void change(MapWriter& writer, Model& model, const MapInfo& info, std::mt19937_64& random,
            std::size_t most_bytes) {
  for (int i = 0; i < 6; ++i) {
    const TileKey key{static_cast<int>(random() % 3), static_cast<int>(random() % 3), 0, 0};
    if (random() % 4 == 0 && model.tiles.erase(key) > 0) {
      ASSERT_TRUE(writer.remove(key).ok());
    } else {
      model.tiles[key] = random_tile(key, info, random, most_bytes);
      add_tile(writer, model.tiles[key]);
    }
  }
}

class PowerCut : public testing::TestWithParam<std::uint64_t> {};

TEST_P(PowerCut, AtEveryMomentTheLastCommitIsWhole) {
  const std::uint64_t seed = GetParam();
  std::mt19937_64 random(seed);
  const MapInfo info = sample_info();
  const std::size_t most_bytes = seed == 5 ? 600000 : 2000;  // large ones bring waypoints
  Disk disk;
  Model committed;
  {
    auto writer = MapWriter::create(std::make_unique<DiskStore>(disk), info);
    change(*writer, committed, info, random, most_bytes);
    ASSERT_TRUE(writer->commit(1).ok());
    committed.revision = 1;
  }
  const int rounds = seed == 5 ? 3 : 12;
  for (int round = 0; round < rounds; ++round) {
    auto writer = MapWriter::open(std::make_unique<DiskStore>(disk));
    if (!writer.ok()) {
      // A torn record at the very end looks like one that was damaged later: kept for repair, never cut.
      ASSERT_EQ(writer.error().code, ErrorCode::kArchiveDamaged);
      disk.durable.resize(open_bytes(disk.durable)->file_bytes());
      continue;
    }
    Model next = committed;
    ASSERT_EQ(writer->revision(), committed.revision);
    change(*writer, next, info, random, most_bytes);
    next.revision = committed.revision + 1;
    for (int i = 0; i < rounds; ++i) expect_survives(disk.crash(random), committed, next);
    disk.syncs_left = static_cast<int>(random() % 3);  // 0: the first fails, 1: the second, 2: none
    const auto done = writer->commit(round);
    for (int i = 0; i < 3 * rounds; ++i) expect_survives(disk.crash(random), committed, next);
    if (done.ok()) {
      committed = next;
    } else {
      const Status again = writer->add({0, 0, 0, 0}, 1, 1, {}, {}, Bytes{1});
      EXPECT_EQ(again.error().code, ErrorCode::kCannotWrite);  // after a failed sync, for good
      disk.durable = disk.crash(random);
      if (const auto archive = open_bytes(disk.durable); archive->revision() == next.revision)
        committed = next;
    }
    disk.pending.clear();
    disk.syncs_left = -1;
    expect_survives(disk.durable, committed, committed);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, PowerCut, testing::Range<std::uint64_t>(1, 25));

TEST(PowerCutHead, TornAtEveryByte) {
  std::mt19937_64 random(5);
  const MapInfo info = sample_info();
  Disk disk;
  Model committed, next;
  {
    auto writer = MapWriter::create(std::make_unique<DiskStore>(disk), info);
    change(*writer, committed, info, random, 50);
    ASSERT_TRUE(writer->commit(1).ok());
    committed.revision = 1;
    next = committed;
    change(*writer, next, info, random, 50);
    next.revision = 2;
    disk.syncs_left = 1;  // segments yes, head no
    ASSERT_FALSE(writer->commit(2).ok());
  }
  ASSERT_EQ(disk.pending.size(), 1u);
  const Disk::Write head = disk.pending[0];
  for (std::size_t count = 0; count <= head.bytes.size(); ++count) {
    Bytes image = disk.durable;
    Disk::put(image, head, count);
    expect_survives(image, committed, next);
    Bytes late = disk.durable;  // the end arrived, the beginning did not
    Disk::put(late,
              {head.offset + count,
               Bytes(head.bytes.begin() + static_cast<std::ptrdiff_t>(count), head.bytes.end())},
              head.bytes.size() - count);
    expect_survives(late, committed, next);
  }
}

TEST(PowerCutFull, AFailedWriteAnywhereLeavesTheLastCommit) {
  const MapInfo info = sample_info();
  for (int writes = 0; writes < 9; ++writes) {
    std::mt19937_64 random(6);
    Disk disk;
    Model committed;
    auto writer = MapWriter::create(std::make_unique<DiskStore>(disk), info);
    change(*writer, committed, info, random, 500);
    ASSERT_TRUE(writer->commit(1).ok());
    committed.revision = 1;
    disk.writes_left = writes;
    bool failed = false;
    for (int i = 0; i < 8 && !failed; ++i) failed = !writer->add({i, 9, 9, 0}, 1, 1, {}, {}, Bytes{1}).ok();
    failed = !writer->commit(2).ok() || failed;
    EXPECT_TRUE(failed);
    for (int i = 0; i < 20; ++i) expect_survives(disk.crash(random), committed, committed);
  }
}

}  // namespace
}  // namespace mapcodec
