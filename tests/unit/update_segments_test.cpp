// SPDX-License-Identifier: GPL-3.0-or-later
// Segments of an updated tile: joining, erasing, hostile bytes.
#include <gtest/gtest.h>

#include "mapcodec/codec/tile_segments.hpp"
#include "mapcodec/quality/novelty.hpp"

namespace mapcodec {
namespace {

MapSchema schema_of(PromiseKind promise, double value) {
  MapSchema s;
  s.promise = promise;
  s.promise_value = value;
  s.tile_size_m = 8;
  s.step_m = promise == PromiseKind::lossless ? 0 : 2 * value;
  s.channels.push_back({{"intensity", ScalarType::f32, 1}, ChannelKept::exact, 0, {}});
  return s;
}

PointCloud grid(int side, double spacing_m, double z = 0) {
  PointCloud c;
  c.channels.push_back({{"intensity", ScalarType::f32, 1}, {}});
  c.resize(std::size_t(side) * std::size_t(side));
  for (int i = 0; i < side * side; ++i) {
    c.xyz[std::size_t(i)] = {1 + spacing_m * float(i % side), 1 + spacing_m * float(i / side), 1 + z};
    for (double& x : c.xyz[std::size_t(i)]) x = float(x);
    c.channels[0].set(std::size_t(i), float(i % 7));
  }
  return c;
}

Bytes encoded(const PointCloud& c, const MapSchema& s) {
  TileSettings settings;
  settings.codec = s.promise == PromiseKind::lossless ? CodecId::lossless : CodecId::points;
  auto t = encode_tile(c, s, settings);
  EXPECT_TRUE(t.ok());
  return std::move(t->bytes);
}

TEST(Segments, JoinAndSplit) {
  const Bytes a{2, 0, 1}, b{4, 0, 2}, c{6, 1};
  const std::vector<Bytes> one{a}, two{a, b};
  EXPECT_EQ(join_segments(one), a);
  const std::vector<Bytes> nested{join_segments(two), c};
  const auto parts = split_segments(join_segments(nested));
  EXPECT_FALSE(parts.ok() && parts->empty());
  const Bytes joined = join_segments(nested);
  const auto split = split_segments(joined);
  ASSERT_TRUE(split.ok());
  ASSERT_EQ(split->size(), 3u);
  EXPECT_TRUE(std::equal((*split)[2].begin(), (*split)[2].end(), c.begin(), c.end()));
}

TEST(Segments, DecodeOneAfterTheOtherAndErase) {
  const MapSchema s = schema_of(PromiseKind::max_error, 0.005);
  const PointCloud low = grid(20, 0.1), high = grid(20, 0.1, 2);
  Erasure box;
  box.box = Box{{0, 0, 0}, {2, 9, 2}};
  const std::vector<Bytes> all{encoded(low, s), write_erasure(box), encoded(high, s)};
  const auto cloud = decode_tile(join_segments(all), s);
  ASSERT_TRUE(cloud.ok()) << cloud.error().message;
  EXPECT_EQ(cloud->size(), 400u - 20u * 10u + 400u);  // what was added after the erasure stays
  EXPECT_EQ(cloud->channels[0].size(), cloud->size());
}

TEST(Segments, EraseByEachCondition) {
  Erasure sphere, values, outside, moved;
  sphere.sphere = Erasure::Sphere{{1, 1, 1}, 0.05};
  values.values = Erasure::Values{"intensity", 3, 3};
  outside.box = Box{{0, 0, 0}, {1.05, 1.05, 2}};
  outside.inverse = true;
  moved.box = Box{{0.95, 0.95, 0}, {1.05, 1.05, 2}};
  moved.motion = std::array<double, 12>{0, -1, 0, 1, 0, 0, 0, 0, 1, 2.1, 0, 0};  // (x, y) -> (2.1 - y, x)
  const auto left = [](const Erasure& e) {
    PointCloud c = grid(10, 0.1);
    const auto again = read_erasure(write_erasure(e));
    EXPECT_TRUE(again.ok());
    EXPECT_TRUE(erase_points(c, *again).ok());
    return c.size();
  };
  EXPECT_EQ(left(sphere), 99u);
  EXPECT_EQ(left(values), 100u - 14u);
  EXPECT_EQ(left(outside), 1u);
  EXPECT_EQ(left(moved), 99u);
}

TEST(Segments, BadErasuresAreRefused) {
  Erasure e;
  e.values = Erasure::Values{"label", 0, 1};
  PointCloud c = grid(2, 0.1);
  EXPECT_EQ(erase_points(c, e).error().code, ErrorCode::kMalformed);
  e.values->least = std::nan("");
  EXPECT_FALSE(read_erasure(write_erasure(e)).ok());
  EXPECT_FALSE(read_erasure(write_erasure(Erasure{})).ok());
  Erasure box;
  box.box = Box{{0, 0, 0}, {1, 1, 1}};
  const Bytes whole = write_erasure(box);
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_FALSE(read_erasure(ByteSpan(whole).first(n)).ok()) << n;
}

TEST(Segments, HostileJoinedBytesNeverCrash) {
  const MapSchema s = schema_of(PromiseKind::max_error, 0.005);
  Erasure box;
  box.box = Box{{0, 0, 0}, {2, 9, 2}};
  const std::vector<Bytes> all{encoded(grid(6, 0.1), s), write_erasure(box), encoded(grid(6, 0.1, 1), s)};
  const Bytes whole = join_segments(all);
  for (std::size_t n = 1; n < whole.size(); ++n) EXPECT_FALSE(decode_tile(ByteSpan(whole).first(n), s).ok());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    Bytes flipped = whole;
    flipped[i] ^= 0x41;
    (void)decode_tile(flipped, s).ok();
  }
  const std::vector<Bytes> only_erased{write_erasure(box), write_erasure(box)};
  const auto empty = decode_tile(join_segments(only_erased), s);
  ASSERT_TRUE(empty.ok());
  EXPECT_TRUE(empty->empty());
  EXPECT_EQ(empty->channels.size(), 1u);
}

TEST(Segments, LimitsHoldForAllTogether) {
  const MapSchema s = schema_of(PromiseKind::max_error, 0.005);
  const std::vector<Bytes> all{encoded(grid(10, 0.1), s), encoded(grid(10, 0.1, 1), s)};
  DecodeLimits limits;
  limits.max_points = 150;
  EXPECT_EQ(decode_tile(join_segments(all), s, limits).error().code, ErrorCode::kLimitExceeded);
}

TEST(Novelty, TheSameScanAddsNothing) {
  for (const PromiseKind promise : {PromiseKind::rms, PromiseKind::max_error, PromiseKind::lossless}) {
    const MapSchema s = schema_of(promise, promise == PromiseKind::lossless ? 0 : 0.01);
    const PointCloud scan = grid(40, 0.013);
    const auto stored = make_stored_points(s, {0, 0, 0});
    EXPECT_EQ(stored->look(scan, 0.01).added.size(), scan.size());
    stored->add(scan, false);
    const Novelty n = stored->look(scan, 0.01);
    EXPECT_TRUE(n.added.empty());
    EXPECT_LE(n.squared_m2, 1e-4 * double(scan.size()));
  }
  EXPECT_EQ(make_stored_points(schema_of(PromiseKind::paper, 0), {0, 0, 0}), nullptr);
}

TEST(Novelty, RmsKeepsItsPromiseForWhatIsLeftOut) {
  const MapSchema s = schema_of(PromiseKind::rms, 0.01);
  const auto stored = make_stored_points(s, {0, 0, 0});
  stored->add(grid(30, 0.027), false);
  PointCloud scan = grid(50, 0.016);
  const Novelty n = stored->look(scan, 0.01);
  EXPECT_GT(n.added.size(), 0u);
  EXPECT_LT(n.added.size(), scan.size());
  const double left = double(scan.size() - n.added.size());
  EXPECT_LE(n.squared_m2, 1e-4 * left * 1.0001);
  // A wall that was not there is new as a whole.
  EXPECT_EQ(stored->look(grid(10, 0.02, 0.5), 0.01).added.size(), 100u);
}

TEST(Novelty, PointsThatHaveLittleMoreByChanceAreKnown) {
  const MapSchema s = schema_of(PromiseKind::rms, 0.01);
  const auto stored = make_stored_points(s, {0, 0, 0});
  stored->add(grid(10, 0.027), false);
  const PointCloud scan = grid(10, 0.027, 0.0105);
  EXPECT_EQ(stored->look(scan, 0.01).added.size(), scan.size());
  EXPECT_EQ(stored->look(scan, 0.01, 0.0104).added.size(), scan.size());
  const Novelty n = stored->look(scan, 0.01, 0.0106);
  EXPECT_TRUE(n.added.empty());
  EXPECT_NEAR(n.squared_m2, 0.0105 * 0.0105 * double(scan.size()), 1e-6);
}

TEST(Novelty, CellsCountTheirPoints) {
  const MapSchema s = schema_of(PromiseKind::max_error, 0.01);
  const auto stored = make_stored_points(s, {0, 0, 0});
  stored->add(grid(10, 0.1), false);
  PointCloud twice = grid(10, 0.1);
  twice.append(grid(10, 0.1));
  EXPECT_EQ(stored->look(twice, 0).added.size(), 100u);
}

TEST(Novelty, EqualPositionsWithOtherValuesAreNewWhereAllIsKept) {
  const MapSchema s = schema_of(PromiseKind::lossless, 0);
  const auto stored = make_stored_points(s, {0, 0, 0});
  PointCloud scan = grid(10, 0.1);
  stored->add(scan, false);
  scan.channels[0].set(5, 99.f);
  EXPECT_EQ(stored->look(scan, 0).added, std::vector<std::uint32_t>{5});
}

}  // namespace
}  // namespace mapcodec
