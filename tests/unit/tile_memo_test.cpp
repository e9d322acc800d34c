// SPDX-License-Identifier: GPL-3.0-or-later
// What an encoder remembers of a tile changes the time, never the bytes.
#include "mapcodec/codec/tile_memo.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "mapcodec/codec/tile_codec.hpp"
#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

struct Colored {
  PointCloud cloud;
  MapSchema schema;
  TileSettings settings;
};

Colored colored_room() {
  Colored c;
  c.cloud.coordinates.kind = CoordinateFormat::Kind::f64;
  c.cloud.xyz = room(4000, 3, 5);
  Channel rgb{{"rgb", ScalarType::u8, 3}, {}};
  for (const Vec3& p : c.cloud.xyz) {
    for (std::size_t d = 0; d < 3; ++d)
      rgb.data.push_back(static_cast<std::uint8_t>(128 + 100 * std::sin(3 * p[d] + 40 * p[(d + 1) % 3])));
  }
  c.schema.promise = PromiseKind::rms;
  c.schema.promise_value = c.schema.step_m = 0.02;
  c.schema.tile_size_m = 4;
  c.schema.coordinates = c.cloud.coordinates;
  c.schema.channels.push_back({rgb.info, ChannelKept::bounded, 10, {}});
  c.cloud.channels.push_back(std::move(rgb));
  c.settings.codec = CodecId::surface;
  return c;
}

TEST(TileMemo, GivesTheSameBytes) {
  Colored c = colored_room();
  TileMemo memo;
  for (const double slope : {100.0, 900.0, 0.0, 100.0}) {
    c.settings.color_slope = slope;
    const auto anew = encode_tile(c.cloud, c.schema, c.settings);
    const auto remembered = encode_tile(c.cloud, c.schema, c.settings, &memo);
    ASSERT_TRUE(anew.ok() && remembered.ok());
    EXPECT_EQ(anew->bytes, remembered->bytes) << slope;
    EXPECT_EQ(anew->errors.color_error, remembered->errors.color_error);
    EXPECT_EQ(anew->errors.rms_m, remembered->errors.rms_m);
    EXPECT_EQ(anew->least_color_error, remembered->least_color_error);
    EXPECT_FALSE(memo.empty());
    EXPECT_GT(memo.bytes(), 0u);
  }
}

TEST(TileMemo, PositionsFirstAreTheSamePositions) {
  Colored c = colored_room();
  MapSchema positions = c.schema;
  positions.channels[0].kept = ChannelKept::dropped;
  TileMemo memo;
  c.settings.color_slope = 300;
  const auto first = encode_tile(c.cloud, positions, c.settings, &memo);
  const auto then = encode_tile(c.cloud, c.schema, c.settings, &memo);
  const auto again = encode_tile(c.cloud, positions, c.settings, &memo);
  const auto anew = encode_tile(c.cloud, c.schema, c.settings);
  ASSERT_TRUE(first.ok() && then.ok() && again.ok() && anew.ok());
  EXPECT_EQ(first->bytes, again->bytes);
  EXPECT_EQ(then->bytes, anew->bytes);
}

/// A tile that was remembered with other settings is coded anew.
void expect_coded_anew(const std::function<void(TileSettings&)>& change) {
  Colored c = colored_room();
  TileMemo memo;
  c.settings.color_slope = 300;
  ASSERT_TRUE(encode_tile(c.cloud, c.schema, c.settings, &memo).ok());
  change(c.settings);
  const auto anew = encode_tile(c.cloud, c.schema, c.settings);
  const auto remembered = encode_tile(c.cloud, c.schema, c.settings, &memo);
  ASSERT_TRUE(anew.ok() && remembered.ok());
  EXPECT_EQ(anew->bytes, remembered->bytes);
}

TEST(TileMemo, AnotherStepIsCodedAnew) {
  expect_coded_anew([](TileSettings& s) { s.step_m = 0.03; });
}
TEST(TileMemo, AnotherTradeIsCodedAnew) {
  expect_coded_anew([](TileSettings& s) { s.trade = {0.4, 0.5}; });
}

TEST(TileMemo, RoughErrorsAreNotRemembered) {
  Colored c = colored_room();
  c.schema.channels[0].kept = ChannelKept::dropped;
  c.settings.rough_errors = true;
  TileMemo memo;
  ASSERT_TRUE(encode_tile(c.cloud, c.schema, c.settings, &memo).ok());
  EXPECT_TRUE(memo.empty());
}

}  // namespace
}  // namespace mapcodec::test
