// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/unit/laz_support.hpp"

#include <gtest/gtest.h>

#include "slam_adapter/formats/las_layout.hpp"
#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using laz_test::File;

/// What LAS would hold.
PointCloud expected(unsigned format, const std::vector<std::string>& rows) {
  const RecordPlan plan =
      las_plan(format, rows[0].size(), {CoordinateFormat::Kind::fixed, {0.01, 0.01, 0.01}, {100, 100, 100}});
  Bytes all;
  for (const std::string& r : rows) all.insert(all.end(), r.begin(), r.end());
  PointCloud cloud = plan.layout.like();
  plan.decode(all.data(), rows.size(), cloud);
  return cloud;
}

void expect_same(const ReadBack& r, const PointCloud& cloud) {
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), cloud.size());
  EXPECT_EQ(r.cloud.xyz, cloud.xyz);
  ASSERT_EQ(r.cloud.channels.size(), cloud.channels.size());
  for (std::size_t c = 0; c < cloud.channels.size(); ++c)
    EXPECT_EQ(r.cloud.channels[c].data, cloud.channels[c].data) << cloud.channels[c].info.name;
}

std::vector<std::string> slice(const std::vector<std::string>& rows, std::size_t begin, std::size_t end) {
  return {rows.begin() + std::ptrdiff_t(begin), rows.begin() + std::ptrdiff_t(end)};
}

TEST(Laz, PointwiseChunks) {
  for (const std::size_t extra : {0u, 3u}) {
    const auto rows = laz_test::rows(3, 5000, extra, 1);
    File f = laz_test::pointwise_file(extra);
    for (const auto& [begin, end] :
         {std::pair<std::size_t, std::size_t>{0, 3000}, {3000, 3001}, {3001, 5000}})
      f.chunks.emplace_back(end - begin, laz_test::pointwise_chunk(slice(rows, begin, end)));
    expect_same(read_text(laz_test::write_laz(f), "a.laz"), expected(3, rows));
    f.table_at_end = true;
    expect_same(read_text(laz_test::write_laz(f), "a.laz"), expected(3, rows));
  }
}

TEST(Laz, OneChunkWithoutTableAndChunksOfOneSize) {
  const auto rows = laz_test::rows(3, 700, 0, 2);
  File f = laz_test::pointwise_file(0);
  f.compressor = 1;
  f.chunks = {{700, laz_test::pointwise_chunk(rows)}};
  expect_same(read_text(laz_test::write_laz(f), "a.laz"), expected(3, rows));
  f.compressor = 2;
  f.chunk_points = 500;
  f.chunks = {{500, laz_test::pointwise_chunk(slice(rows, 0, 500))},
              {200, laz_test::pointwise_chunk(slice(rows, 500, 700))}};
  expect_same(read_text(laz_test::write_laz(f), "a.laz"), expected(3, rows));
}

TEST(Laz, LayeredChunks) {
  for (const std::size_t extra : {0u, 2u}) {
    const auto rows = laz_test::rows(7, 4000, extra, 3);
    File f = laz_test::layered_file(extra);
    f.chunks = {{2500, laz_test::layered_chunk(slice(rows, 0, 2500))},
                {1500, laz_test::layered_chunk(slice(rows, 2500, 4000))}};
    expect_same(read_text(laz_test::write_laz(f), "a.laz"), expected(7, rows));
  }
}

/// Any bytes are symbols: what no plain encoder writes (changes of channel, sequences of times, returns,
/// infrared) is decoded from noise, twice alike and without an end before its time.
TEST(Laz, NoiseIsDecodedAlike) {
  std::mt19937 random(4);
  const auto noise = [&](std::size_t n) {
    std::string r;
    for (std::size_t i = 0; i < n; ++i) r.push_back(static_cast<char>(random()));
    return r;
  };
  File f;
  f.minor = 4;
  f.format = 8;
  f.compressor = 3;
  f.stride = 38 + 2;
  f.items = {{10, 30, 3}, {12, 8, 3}, {14, 2, 3}};
  std::string chunk = noise(40);
  laz_test::put(chunk, std::uint32_t{300});
  for (int layer = 0; layer < 13; ++layer) laz_test::put(chunk, std::uint32_t{6000});
  chunk += noise(13 * 6000);
  f.chunks = {{300, chunk}};
  const std::string bytes = laz_test::write_laz(f);
  const ReadBack a = read_text(bytes, "a.laz"), b = read_text(bytes, "a.laz");
  ASSERT_TRUE(a.status.ok()) << message(a);
  expect_same(b, a.cloud);
  std::array<bool, 4> channels{};
  for (std::size_t i = 0; i < a.cloud.size(); ++i)
    channels[a.cloud.find("scanner_channel")->get<std::uint8_t>(i)] = true;
  EXPECT_EQ(channels, (std::array<bool, 4>{true, true, true, true}));
}

TEST(Laz, WhatIsNotReadIsNamed) {
  const auto rows = laz_test::rows(3, 10, 0, 5);
  File f = laz_test::pointwise_file(0);
  f.chunks = {{10, laz_test::pointwise_chunk(rows)}};
  f.items[0].version = 1;
  EXPECT_TRUE(fails_with(read_text(laz_test::write_laz(f), "a.laz"), ErrorCode::kUnsupported, "laszip -i"));
  f.items[0].version = 2;
  f.items.pop_back();
  EXPECT_TRUE(
      fails_with(read_text(laz_test::write_laz(f), "a.laz"), ErrorCode::kMalformed, "do not make up"));
  f = laz_test::pointwise_file(0);
  f.chunks = {{10, laz_test::pointwise_chunk(rows)}};
  std::string bytes = laz_test::write_laz(f);
  bytes[227 + 2] = 'x';
  EXPECT_TRUE(fails_with(read_text(bytes, "a.laz"), ErrorCode::kMalformed, "without the record"));
  f.chunks[0].first = 11;
  EXPECT_TRUE(fails_with(read_text(laz_test::write_laz(f), "a.laz"), ErrorCode::kTruncated,
                         "before its last point") ||
              read_text(laz_test::write_laz(f), "a.laz").cloud.size() == 11);
}

TEST(Laz, CutAndFlippedFilesNeverCrash) {
  const auto rows3 = laz_test::rows(3, 60, 1, 6), rows7 = laz_test::rows(7, 60, 1, 7);
  File a = laz_test::pointwise_file(1), b = laz_test::layered_file(1);
  a.chunks = {{30, laz_test::pointwise_chunk(slice(rows3, 0, 30))},
              {30, laz_test::pointwise_chunk(slice(rows3, 30, 60))}};
  b.chunks = {{60, laz_test::layered_chunk(rows7)}};
  for (const File& f : {a, b}) {
    const std::string whole = laz_test::write_laz(f);
    // The last four bytes are zeros that no decoder asks for.
    for (std::size_t size = 0; size + 5 < whole.size(); size += 3)
      EXPECT_FALSE(read_text(whole.substr(0, size), "a.laz").status.ok()) << size;
    std::string bytes = whole;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] = static_cast<char>(bytes[i] ^ 0x91);
      (void)read_text(bytes, "a.laz");
      bytes[i] = whole[i];
    }
  }
}

}  // namespace
}  // namespace mapcodec
