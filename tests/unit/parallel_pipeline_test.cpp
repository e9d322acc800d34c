// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "parallel/encode_pipeline.hpp"
#include "parallel/tbb_arena.hpp"
#include "parallel_clouds.hpp"

namespace mapcodec {
namespace {

using test::BlockSource;
using test::floor_and_wall;
using test::with_channels;

/// Eight threads also on a machine with fewer cores.
const tbb::global_control kThreads(tbb::global_control::max_allowed_parallelism, 8);

TileSet make_tiles(std::size_t points = 50000) {
  PointCloud cloud = with_channels(floor_and_wall(points));
  BlockSource source(cloud);
  const Result<Survey> s = survey(source, {});
  TilePlanSettings settings;
  settings.target_points = 500;
  const Result<TilePlan> p = plan_tiles(*s, settings);
  Result<TileSet> set = build_tiles(std::move(cloud), *p, {});
  EXPECT_TRUE(set.ok());
  return std::move(set).value();
}

/// The first channel's bytes; as slow as asked, so that tiles finish out of order.
EncodedTile fake_encode(const PointCloud& tile, int spin = 0) {
  EncodedTile e;
  e.bytes = tile.channels[0].data;
  e.points = e.input_points = tile.size();
  for (int i = 0; i < spin; ++i) std::this_thread::yield();
  return e;
}

struct Delivered {
  TileKey key;
  Bytes bytes;
  bool operator==(const Delivered&) const = default;
};

std::vector<Delivered> encode_all(const TileSet& set, const PipelineSettings& settings) {
  std::vector<Delivered> out;
  const TileEncoder encode = [](const PointCloud& t) {
    return Result<EncodedTile>(fake_encode(t, static_cast<int>(t.size() * 7 % 100)));
  };
  const Status s = encode_tiles(set, encode, settings, [&](const TileKey& key, EncodedTile&& e) {
    out.push_back({key, std::move(e.bytes)});
    return Status();
  });
  EXPECT_TRUE(s.ok());
  return out;
}

TEST(EncodeTiles, SameForAnyNumberOfThreads) {
  const TileSet set = make_tiles();
  const std::vector<Delivered> serial = encode_all(set, {});
  ASSERT_EQ(serial.size(), set.tiles().size());
  for (std::size_t i = 0; i < serial.size(); ++i) {
    EXPECT_EQ(serial[i].key, set.tiles()[i].key);
    EXPECT_EQ(serial[i].bytes, set.load(i)->channels[0].data);
  }
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    for (const std::size_t in_flight : {0u, 1u, 3u}) {
      PipelineSettings settings;
      settings.arena = &arena;
      settings.max_tiles_in_flight = in_flight;
      EXPECT_EQ(encode_all(set, settings), serial);
    }
  }
}

TEST(EncodeTiles, ReportsProgressAndSeconds) {
  const TileSet set = make_tiles();
  tbb::task_arena native(2);
  Arena arena = borrow_arena(native);
  std::vector<double> seconds;
  Progress last;
  PipelineSettings settings;
  settings.arena = &arena;
  settings.tile_seconds = &seconds;
  settings.progress = [&](const Progress& p) {
    EXPECT_GT(p.done, last.done);
    last = p;
  };
  encode_all(set, settings);
  EXPECT_EQ(last.done, 50000u);
  EXPECT_EQ(last.total, 50000u);
  EXPECT_EQ(last.bytes_out, 150000u);
  ASSERT_EQ(seconds.size(), set.tiles().size());
  for (const double s : seconds) EXPECT_GT(s, 0);
}

TEST(EncodeTiles, BoundsTheTilesInFlight) {
  const TileSet set = make_tiles();
  Arena arena(8);
  for (const std::uint64_t budget : {std::uint64_t{0}, std::uint64_t{1} << 30}) {
    PipelineSettings settings;
    settings.arena = &arena;
    settings.memory_budget_bytes = budget;
    settings.max_tiles_in_flight = 3;
    std::atomic<int> now{0}, most{0};
    const TileEncoder encode = [&](const PointCloud& t) {
      const int n = ++now;
      for (int m = most; n > m && !most.compare_exchange_weak(m, n);) {
      }
      return Result<EncodedTile>(fake_encode(t, 50));
    };
    const EncodedSink sink = [&](const TileKey&, EncodedTile&&) {
      --now;
      return Status();
    };
    ASSERT_TRUE(encode_tiles(set, encode, settings, sink).ok());
    EXPECT_LE(most, budget == 0 ? 1 : 3);
  }
}

TEST(EncodeTiles, FirstErrorInOrderWinsAndIsNamed) {
  const TileSet set = make_tiles();
  const std::uint64_t third = set.tiles()[3].points;
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    PipelineSettings settings;
    settings.arena = &arena;
    std::vector<TileKey> delivered;
    const Bytes first = set.load(3)->channels[0].data;
    const TileEncoder encode = [&](const PointCloud& t) -> Result<EncodedTile> {
      const bool is_third = t.size() == third && t.channels[0].data == first;
      if (is_third) {
        for (int i = 0; i < 1000; ++i) std::this_thread::yield();
        return make_error(ErrorCode::kInvalidArgument, "the third");
      }
      for (std::size_t i = 0; i < 3; ++i) {
        if (t.channels[0].data == set.load(i)->channels[0].data) return fake_encode(t);
      }
      return make_error(ErrorCode::kMalformed, "a later one");
    };
    const Status s = encode_tiles(set, encode, settings, [&](const TileKey& key, EncodedTile&&) {
      delivered.push_back(key);
      return Status();
    });
    ASSERT_FALSE(s.ok());
    EXPECT_EQ(s.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(s.error().message, tile_name(set.tiles()[3].key) + ": the third");
    EXPECT_EQ(delivered.size(), 3u);
  }
}

TEST(EncodeTiles, ExceptionsBecomeErrors) {
  const TileSet set = make_tiles();
  Arena arena(2);
  PipelineSettings settings;
  settings.arena = &arena;
  const EncodedSink accept = [](const TileKey&, EncodedTile&&) { return Status(); };
  const TileEncoder throws = [](const PointCloud&) -> Result<EncodedTile> {
    throw std::runtime_error("geometry");
  };
  const Status a = encode_tiles(set, throws, settings, accept);
  EXPECT_NE(a.error().message.find("geometry"), std::string::npos);
  const TileEncoder no_memory = [](const PointCloud&) -> Result<EncodedTile> { throw std::bad_alloc(); };
  EXPECT_EQ(encode_tiles(set, no_memory, settings, accept).error().code, ErrorCode::kLimitExceeded);
  const TileEncoder good = [](const PointCloud& t) { return Result<EncodedTile>(fake_encode(t)); };
  const EncodedSink sink_throws = [](const TileKey&, EncodedTile&&) -> Status { throw 5; };
  EXPECT_FALSE(encode_tiles(set, good, settings, sink_throws).ok());
}

TEST(EncodeTiles, SinkErrorsAndStopEndIt) {
  const TileSet set = make_tiles();
  for (const int threads : {1, 2}) {
    Arena arena(threads);
    PipelineSettings settings;
    settings.arena = &arena;
    const TileEncoder encode = [](const PointCloud& t) { return Result<EncodedTile>(fake_encode(t)); };
    int calls = 0;
    const EncodedSink full = [&](const TileKey&, EncodedTile&&) -> Status {
      if (++calls < 5) return {};
      return make_error(ErrorCode::kCannotWrite, "disk full");
    };
    EXPECT_EQ(encode_tiles(set, encode, settings, full).error().code, ErrorCode::kCannotWrite);
    EXPECT_EQ(calls, 5);
    std::atomic<bool> stop{false};
    settings.stop = &stop;
    calls = 0;
    const EncodedSink stops = [&](const TileKey&, EncodedTile&&) {
      if (++calls == 3) stop = true;
      return Status();
    };
    EXPECT_EQ(encode_tiles(set, encode, settings, stops).error().code, ErrorCode::kCancelled);
    EXPECT_LT(calls, 20);
  }
}

PointCloud cloud_of(ByteSpan bytes) {
  PointCloud c;
  for (const std::uint8_t b : bytes) c.xyz.push_back({static_cast<double>(b), 0, 0});
  return c;
}

TEST(DecodeTiles, InOrderForAnyNumberOfThreads) {
  const auto fetch = [](std::size_t i) {
    return Result<Bytes>(Bytes(i % 5 + 1, static_cast<std::uint8_t>(i)));
  };
  const TileDecoder decode = [](ByteSpan b) {
    for (int i = 0; i < b[0] % 7; ++i) std::this_thread::yield();
    return Result<PointCloud>(cloud_of(b));
  };
  for (const int threads : {1, 2, 8}) {
    Arena arena(threads);
    PipelineSettings settings;
    settings.arena = &arena;
    std::size_t next = 0;
    const Status s = decode_tiles(200, fetch, decode, settings, [&](std::size_t i, PointCloud&& c) {
      EXPECT_EQ(i, next++);
      EXPECT_EQ(c.xyz.size(), i % 5 + 1);
      EXPECT_EQ(c.xyz[0][0], static_cast<double>(i));
      return Status();
    });
    EXPECT_TRUE(s.ok());
    EXPECT_EQ(next, 200u);
  }
}

TEST(DecodeTiles, ErrorsCarryTheirNumber) {
  Arena arena(2);
  PipelineSettings settings;
  settings.arena = &arena;
  const auto fetch = [](std::size_t i) { return Result<Bytes>(Bytes{static_cast<std::uint8_t>(i)}); };
  const TileDecoder decode = [](ByteSpan b) -> Result<PointCloud> {
    if (b[0] >= 9) return make_error(ErrorCode::kMalformed, "bad", 17);
    return cloud_of(b);
  };
  std::size_t got = 0;
  const DecodedSink sink = [&](std::size_t, PointCloud&&) {
    ++got;
    return Status();
  };
  const Status s = decode_tiles(100, fetch, decode, settings, sink);
  ASSERT_FALSE(s.ok());
  EXPECT_EQ(s.error().to_string(), "tile number 9: bad (at byte 17)");
  EXPECT_EQ(got, 9u);
  const auto broken = [](std::size_t) {
    return Result<Bytes>(make_error(ErrorCode::kChecksumMismatch, "crc"));
  };
  EXPECT_EQ(decode_tiles(3, broken, decode, settings, sink).error().code, ErrorCode::kChecksumMismatch);
  EXPECT_TRUE(decode_tiles(0, broken, decode, settings, sink).ok());
}

}  // namespace
}  // namespace mapcodec
