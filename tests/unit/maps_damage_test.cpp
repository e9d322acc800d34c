// SPDX-License-Identifier: GPL-3.0-or-later
// Damage, crashes, full disks: an error or the last whole revision, never a crash, never silence.
#include "tests/unit/maps_support.hpp"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <chrono>
#include <thread>

#include "mapcodec/base/crc32c.hpp"
#include "maps/commit_record.hpp"

namespace mapcodec {
namespace {

using namespace maps_test;

/// Two commits, the second a delta; `first_end` is where the first ends.
Bytes two_commits(std::size_t& first_end, std::size_t tiles = 20, std::size_t most_bytes = 40) {
  auto store = std::make_unique<MemoryStore>();
  const MemoryStore& memory = *store;
  const MapInfo info = sample_info();
  auto writer = MapWriter::create(std::move(store), info);
  const auto all = random_tiles(tiles, info, 1, most_bytes);
  for (const SampleTile& t : all) add_tile(*writer, t);
  EXPECT_TRUE(writer->commit(1).ok());
  first_end = memory.bytes().size();
  std::mt19937_64 random(2);
  add_tile(*writer, random_tile({9, 9, 9, 0}, info, random, most_bytes));
  EXPECT_TRUE(writer->remove(all[3].key).ok());
  EXPECT_TRUE(writer->commit(2).ok());
  return memory.bytes();
}

TEST(MapDamage, CutAtEveryLength) {
  std::size_t first_end = 0;
  const Bytes whole = two_commits(first_end);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto archive =
        open_bytes(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)));
    if (length < first_end) {
      ASSERT_FALSE(archive.ok()) << length;
      EXPECT_EQ(archive.error().code, length == 0 ? ErrorCode::kEmpty : ErrorCode::kArchiveDamaged);
      continue;
    }
    ASSERT_TRUE(archive.ok()) << length << ": " << archive.error().to_string();
    EXPECT_EQ(archive->revision(), 1u);
    EXPECT_EQ(archive->trailing_bytes(), length - first_end);
    EXPECT_EQ(archive->verify()->ok(), length == first_end);
    EXPECT_EQ(archive->verify()->only_unfinished(), length > first_end);
    EXPECT_EQ(archive->verify()->trailing_bytes, length - first_end);
  }
  EXPECT_EQ(open_bytes(whole)->revision(), 2u);
}

TEST(MapDamage, AWriterContinuesAfterEveryTornTail) {
  std::size_t first_end = 0;
  const Bytes whole = two_commits(first_end);
  const MapInfo info = sample_info();
  std::mt19937_64 random(2);
  const SampleTile tile = random_tile({-9, 9, 9, 0}, info, random);
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  for (std::size_t length = first_end; length < whole.size(); ++length) {
    write_file(path, ByteSpan(whole).first(length));
    auto writer = MapWriter::open(path);
    ASSERT_TRUE(writer.ok()) << length << ": " << writer.error().to_string();
    add_tile(*writer, tile);
    ASSERT_EQ(writer->commit(3).value(), 2u);
    const auto archive = MapArchive::open(path);
    ASSERT_TRUE(archive.ok());
    EXPECT_EQ(archive->tiles().size(), 21u);
    EXPECT_TRUE(archive->verify()->ok());
  }
}

TEST(MapDamage, EveryFlippedBitIsFound) {
  std::size_t first_end = 0;
  Bytes bytes = two_commits(first_end);
  ASSERT_TRUE(is_flawless(bytes));
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1u << bit);
      ASSERT_FALSE(is_flawless(bytes)) << "byte " << at << " bit " << bit;
      if (const auto archive = open_bytes(bytes); archive.ok()) {
        EXPECT_FALSE(archive->verify()->only_unfinished()) << "byte " << at << " bit " << bit;
      }
      bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1u << bit);
    }
  }
}

TEST(MapDamage, AThousandFlipsInALargerMap) {
  std::size_t first_end = 0;
  const Bytes whole = two_commits(first_end, 400, 2000);
  std::mt19937_64 random(5);
  for (int i = 0; i < 1000; ++i) {
    Bytes bytes = whole;
    for (std::size_t n = 1 + random() % 3; n > 0; --n)
      bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
    if (bytes != whole) {
      EXPECT_FALSE(is_flawless(bytes)) << i;
    }
  }
}

TEST(MapDamage, ATileThatDoesNotMatchSaysWhere) {
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  const MapInfo info = sample_info();
  const auto tiles = random_tiles(5, info, 1);
  write_map(path, info, tiles);
  Bytes bytes = read_file(path);
  const auto archive = open_bytes(bytes);
  const SegmentRef segment = archive->tiles()[2].segments[0];
  bytes[segment.offset] ^= 1;
  const auto damaged = open_bytes(bytes);
  ASSERT_TRUE(damaged.ok());
  const auto read = damaged->read(segment);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kChecksumMismatch);
  EXPECT_EQ(read.error().offset, segment.offset);
  EXPECT_NE(read.error().message.find(tile_name(damaged->tiles()[2])), std::string::npos);
  EXPECT_TRUE(damaged->read(damaged->tiles()[1].segments[0]).ok());
  EXPECT_EQ(damaged->verify()->findings.size(), 1u);
  EXPECT_EQ(damaged->read({bytes.size(), 10, 0}).error().code, ErrorCode::kArchiveDamaged);
}

TEST(MapDamage, WhatIsNoArchive) {
  TemporaryFolder folder;
  const auto code = [&](const Bytes& bytes) {
    write_file(folder.path("x"), bytes);
    return MapArchive::open(folder.path("x")).error().code;
  };
  EXPECT_EQ(code({}), ErrorCode::kEmpty);
  EXPECT_EQ(code({'p', 'l', 'y'}), ErrorCode::kMalformed);
  EXPECT_EQ(code(random_bytes(5000, 1)), ErrorCode::kMalformed);
  EXPECT_EQ(MapArchive::open(folder.path("x")).error().message, "is not a mapcodec archive");
  const auto header = archive_header();
  Bytes bytes(header.begin(), header.end());
  EXPECT_EQ(code(bytes), ErrorCode::kArchiveDamaged);
  EXPECT_EQ(code({bytes[0], bytes[1]}), ErrorCode::kArchiveDamaged);
  bytes[6] = 1;
  EXPECT_EQ(code(bytes), ErrorCode::kUnsupported);
  EXPECT_EQ(code({0x89, 'M', 'P', 'C', '\n', 0, 1, 0, 0}), ErrorCode::kArchiveDamaged);  // CR LF became LF
  EXPECT_EQ(code({0x89, 'M', 'P', 'C', '\r', '\r', '\n', 0, 1, 0}),
            ErrorCode::kArchiveDamaged);  // LF became CR LF
  EXPECT_EQ(code({0x09, 'M', 'P', 'C', '\r', '\n', 0, 1, 0, 0}), ErrorCode::kArchiveDamaged);  // seven bits
  EXPECT_EQ(MapArchive::open(folder.path("absent")).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(MapArchive::open(folder.path(".")).error().code, ErrorCode::kUnreadable);
  EXPECT_EQ(MapArchive::open("/dev/null").error().code, ErrorCode::kUnreadable);
  EXPECT_EQ(verify_archive(folder.path("absent")).error().code, ErrorCode::kNotFound);
}

TEST(MapDamage, ALastCommitThatRottedIsNotCutOff) {
  std::size_t first_end = 0;
  Bytes bytes = two_commits(first_end);
  bytes[bytes.size() - 40] ^= 4;
  EXPECT_EQ(open_bytes(bytes)->revision(), 1u);
  TemporaryFolder folder;
  write_file(folder.path("m.mapc"), bytes);
  EXPECT_EQ(MapWriter::open(folder.path("m.mapc")).error().code, ErrorCode::kArchiveDamaged);
  EXPECT_EQ(read_file(folder.path("m.mapc")), bytes);
}

TEST(MapDamage, AnArchiveInsideATileIsNotMistakenForOne) {
  std::size_t first_end = 0;
  const Bytes inner = two_commits(first_end);
  auto store = std::make_unique<MemoryStore>();
  MemoryStore& memory = *store;
  auto writer = MapWriter::create(std::move(store), sample_info());
  ASSERT_TRUE(writer->add({}, 1, 1, {}, {}, inner).ok());
  EXPECT_FALSE(open_bytes(memory.bytes()).ok());
  ASSERT_TRUE(writer->commit(1).ok());
  ASSERT_TRUE(writer->add({}, 1, 1, {}, {}, inner).ok());
  const auto archive = open_bytes(memory.bytes());
  ASSERT_TRUE(archive.ok());
  EXPECT_EQ(archive->tiles().size(), 1u);
}

/// A well-signed commit around any index and metadata.
Bytes signed_archive(const Bytes& index, const Bytes& metadata) {
  const auto header = archive_header();
  Bytes bytes(header.begin(), header.end());
  Bytes blocks = index;
  blocks.insert(blocks.end(), metadata.begin(), metadata.end());
  bytes.insert(bytes.end(), blocks.begin(), blocks.end());
  CommitRecord record;
  record.revision = 1;
  record.index_bytes = static_cast<std::uint32_t>(index.size());
  record.metadata_bytes = static_cast<std::uint32_t>(metadata.size());
  const auto tail = write_record(record, bytes.size(), blocks);
  bytes.insert(bytes.end(), tail.begin(), tail.end());
  return bytes;
}

TEST(MapDamage, SignedNonsenseIsRefused) {
  // The checksum protects against accidents, not against malice: here it always matches.
  std::size_t first_end = 0;
  const Bytes good = two_commits(first_end);
  const auto commit = read_commit(MemoryStore(good), first_end - kRecordBytes);
  ASSERT_TRUE(commit.ok());
  const Bytes index(commit->index().begin(), commit->index().end());
  const Bytes metadata(commit->metadata().begin(), commit->metadata().end());
  std::mt19937_64 random(8);
  int opened = 0;
  for (int i = 0; i < 20000; ++i) {
    Bytes a = index, b = metadata;
    Bytes& target = i % 2 == 0 ? a : b;
    for (std::size_t n = 1 + random() % 4; n > 0; --n)
      target[random() % target.size()] = static_cast<std::uint8_t>(random() % 3 == 0 ? 255 : random());
    const auto archive = open_bytes(signed_archive(a, b));
    opened += archive.ok() ? 1 : 0;
    if (archive.ok()) {
      EXPECT_TRUE(archive->verify().ok());
    }
  }
  EXPECT_LT(opened, 15000);
  EXPECT_FALSE(open_bytes(signed_archive({}, metadata)).ok());
  EXPECT_FALSE(
      open_bytes(signed_archive({0, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0, 0}, metadata)).ok());  // 4 billion tiles
  EXPECT_FALSE(open_bytes(signed_archive({1, 0, 0, 0, 0, 0}, metadata)).ok());  // a delta of nothing
}

/// Runs `work` in a child process; it must not return.
template <class Work>
pid_t spawn(Work work) {
  const pid_t pid = ::fork();
  if (pid == 0) {
    work();
    ::_exit(3);
  }
  return pid;
}

TEST(MapCrash, KilledWriterLeavesTheOldArchiveOrNone) {
  const MapInfo info = sample_info();
  std::mt19937_64 random(13);
  for (int i = 0; i < 40; ++i) {
    TemporaryFolder folder;
    const std::string path = folder.path("m.mapc");
    const bool exists = i % 2 == 0;
    if (exists) write_map(path, info, random_tiles(3, info, 1));
    const Bytes before = read_file(path);
    const pid_t child = spawn([&] {
      auto writer = MapWriter::create(path, info, true);
      for (int n = 0;; ++n) (void)writer->add({n, 0, 0, 0}, 1, 1, {}, {}, random_bytes(1000, 1));
    });
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 20000));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(std::filesystem::exists(path), exists);
    EXPECT_EQ(read_file(path), before);
  }
}

TEST(MapCrash, KilledUpdaterLeavesAWholeRevision) {
  const MapInfo info = sample_info();
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  write_map(path, info, random_tiles(3, info, 1));
  std::mt19937_64 random(13);
  std::uint64_t last = 1;
  for (int i = 0; i < 40; ++i) {
    const pid_t child = spawn([&] {
      auto writer = MapWriter::open(path);
      if (!writer.ok()) ::_exit(4);
      for (int n = 0;; ++n) {
        if (!writer->add({n, i, 1000, 0}, 1, 1, {}, {}, random_bytes(2000, 1)).ok()) ::_exit(5);
        if (n % 3 == 2 && !writer->commit(n).ok()) ::_exit(6);
      }
    });
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 10000));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status)) << WEXITSTATUS(status);
    const auto archive = MapArchive::open(path);
    ASSERT_TRUE(archive.ok()) << archive.error().to_string();
    EXPECT_GE(archive->revision(), last);
    last = archive->revision();
    for (const TileRecord& t : archive->tiles()) ASSERT_TRUE(archive->read(t.segments[0]).ok());
  }
  const auto log = MapArchive::open(path)->log();
  ASSERT_TRUE(log.ok());
  EXPECT_EQ(log->size(), last);
}

/// Exit code of a child that works under a limit on file sizes: a disk that fills up.
template <class Work>
int with_full_disk(std::uint64_t bytes, Work work) {
  const pid_t child = spawn([&] {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    ::_exit(work());
  });
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int fill(Result<MapWriter> writer) {
  if (!writer.ok()) return writer.error().code == ErrorCode::kCannotWrite ? 0 : 1;
  Status added;
  for (int n = 0; added.ok() && n < 100; ++n)
    added = writer->add({n, 0, 0, 0}, 1, 1, {}, {}, random_bytes(1000, 1));
  if (added.ok()) added = writer->commit(0).ok() ? Status() : make_error(ErrorCode::kCannotWrite, "");
  if (added.ok() || added.error().code != ErrorCode::kCannotWrite) return 2;
  return writer->commit(0).ok() ? 3 : 0;  // failed for good
}

TEST(MapCrash, FullDisk) {
  const MapInfo info = sample_info();
  TemporaryFolder folder;
  const std::string path = folder.path("m.mapc");
  for (const std::uint64_t bytes : {4u, 9000u, 99990u, 100010u, 100100u}) {
    EXPECT_EQ(with_full_disk(bytes, [&] { return fill(MapWriter::create(path, info, false)); }), 0) << bytes;
    EXPECT_EQ(folder.files(), 0u);
  }
  write_map(path, info, random_tiles(3, info, 1));
  const Bytes before = read_file(path);
  for (const std::uint64_t bytes : {9000u, 100500u}) {
    EXPECT_EQ(with_full_disk(bytes, [&] { return fill(MapWriter::open(path)); }), 0) << bytes;
    EXPECT_EQ(read_file(path), before);
  }
}

}  // namespace
}  // namespace mapcodec
