// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/crc32c.hpp"
#include "mapcodec/cloud/tile_key.hpp"
#include "mapcodec/entropy/integer_model.hpp"

namespace mapcodec {
namespace {

TEST(Crc32c, KnownVector) {
  const std::string s = "123456789";
  const Bytes b(s.begin(), s.end());
  EXPECT_EQ(crc32c(b), 0xE3069283u);
  EXPECT_EQ(crc32c({}), 0u);
}

TEST(Crc32c, ContinuesFromASeed) {
  Bytes b(1000);
  for (std::size_t i = 0; i < b.size(); ++i) b[i] = static_cast<std::uint8_t>(i * 7);
  for (const std::size_t cut : {0u, 1u, 7u, 8u, 500u, 1000u}) {
    const ByteSpan s(b);
    EXPECT_EQ(crc32c(s.subspan(cut), crc32c(s.first(cut))), crc32c(s));
  }
}

TEST(ByteReader, FailsForGood) {
  const Bytes b{1, 2, 3};
  ByteReader r(b);
  EXPECT_EQ(r.u16(), 0x0201);
  EXPECT_EQ(r.u32(), 0u);
  EXPECT_FALSE(r.ok());
  EXPECT_EQ(r.u8(), 0);
  EXPECT_FALSE(r.ok());
  EXPECT_EQ(r.status("x").error().code, ErrorCode::kTruncated);
}

TEST(ByteReader, VarintsRoundTrip) {
  ByteWriter w;
  const std::uint64_t values[] = {0, 1, 127, 128, 300, std::uint64_t{1} << 63, ~std::uint64_t{0}};
  const std::int64_t signed_values[] = {0, -1, 1, std::numeric_limits<std::int64_t>::min(),
                                        std::numeric_limits<std::int64_t>::max()};
  for (const auto v : values) w.varint(v);
  for (const auto v : signed_values) w.signed_varint(v);
  ByteReader r(w.bytes());
  for (const auto v : values) EXPECT_EQ(r.varint(), v);
  for (const auto v : signed_values) EXPECT_EQ(r.signed_varint(), v);
  EXPECT_TRUE(r.ok());
  EXPECT_EQ(r.left(), 0u);
}

TEST(ByteReader, RefusesOverlongVarint) {
  const Bytes b(11, 0xff);
  ByteReader r(b);
  EXPECT_EQ(r.varint(), 0u);
  EXPECT_FALSE(r.ok());
}

TEST(RangeCoder, IntegersRoundTripAndEndIsNoticed) {
  std::mt19937_64 rng(1);
  std::vector<std::uint64_t> values;
  for (int i = 0; i < 20000; ++i) values.push_back(rng() >> (rng() % 64));
  values.push_back(~std::uint64_t{0});
  RangeEncoder enc;
  IntegerModel model;
  for (const auto v : values) model.encode(enc, v);
  const Bytes b = enc.finish();
  RangeDecoder dec(b);
  IntegerModel again;
  for (const auto v : values) ASSERT_EQ(again.decode(dec), v);
  EXPECT_TRUE(dec.ok());
  for (int i = 0; i < 100; ++i) (void)dec.decode_raw(64);
  EXPECT_FALSE(dec.ok());
}

TEST(TileKey, MortonOrderPutsNegativeFirstAndParentsBeforeChildren) {
  const MortonLess less;
  EXPECT_TRUE(less({-1, 0, 0, 0}, {0, 0, 0, 0}));
  EXPECT_TRUE(less({0, 0, 0, 0}, {1, 0, 0, 0}));
  EXPECT_TRUE(less({1, 0, 0, 0}, {0, 1, 0, 0}));
  EXPECT_TRUE(less({0, 0, 0, 1}, {0, 0, 0, 0}));
  EXPECT_TRUE(less({5, 5, 5, 0}, TileKey::unplaced()));
  EXPECT_FALSE(less({5, 5, 5, 0}, {5, 5, 5, 0}));
}

}  // namespace
}  // namespace mapcodec
