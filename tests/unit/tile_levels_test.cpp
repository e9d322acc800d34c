// SPDX-License-Identifier: GPL-3.0-or-later
// Levels of detail: nearer with each level, the last one everything, the first bytes enough.
#include "mapcodec/codec/tile_levels.hpp"

#include <gtest/gtest.h>

#include "mapcodec/quality/evaluation.hpp"
#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

struct Tile {
  PointCloud cloud;
  MapSchema schema;
  Bytes bytes;
};

Tile tile_of(const Cloud& points, CodecId codec, double step) {
  Tile t;
  t.schema.promise = PromiseKind::rms;
  t.schema.promise_value = step;
  t.schema.tile_size_m = 4;
  t.schema.step_m = step;
  t.schema.coordinates.kind = CoordinateFormat::Kind::f64;
  t.cloud.coordinates = t.schema.coordinates;
  t.cloud.xyz = points;
  TileSettings settings;
  settings.codec = codec;
  auto e = encode_tile(t.cloud, t.schema, settings);
  EXPECT_TRUE(e.ok());
  t.bytes = std::move(e->bytes);
  return t;
}

double rms(const PointCloud& a, const PointCloud& b) {
  SerialRunner serial;
  EvaluationSettings settings;
  settings.with_normals = false;
  const auto e = evaluate(a, b, serial, settings);
  EXPECT_TRUE(e.ok());
  return e.ok() ? e->rms_m : NAN;
}

TEST(TileLevels, ComeNearerAndEndInTheWhole) {
  for (const CodecId codec : {CodecId::surface, CodecId::points}) {
    const Tile t = tile_of(room(4000, 3, 5), codec, 0.02);
    const auto levels = count_tile_levels(t.bytes, t.schema);
    ASSERT_TRUE(levels.ok());
    ASSERT_GE(*levels, 4u);
    double last = 1e9;
    for (unsigned level = 0; level < *levels; ++level) {
      const auto d = decode_tile_coarsely(t.bytes, t.schema, level);
      ASSERT_TRUE(d.ok());
      ASSERT_EQ(d->size(), t.cloud.size());
      const double error = rms(t.cloud, *d);
      EXPECT_LE(error, 1.05 * last + 1e-9) << codec_name(codec) << " level " << level;
      last = error;
    }
    const auto whole = decode_tile(t.bytes, t.schema);
    ASSERT_TRUE(whole.ok());
    for (const unsigned level : {*levels - 1, *levels, kMostTileLevel, ~0u}) {
      const auto d = decode_tile_coarsely(t.bytes, t.schema, level);
      ASSERT_TRUE(d.ok());
      EXPECT_EQ(d->xyz, whole->xyz) << codec_name(codec) << " level " << level;
    }
  }
}

TEST(TileLevels, ErrorsAreOfTheCellsSize) {
  for (const CodecId codec : {CodecId::surface, CodecId::points}) {
    const Tile t = tile_of(room(4000, 3, 5), codec, 0.005);
    for (unsigned level = 0; level < 10; ++level) {
      const auto d = decode_tile_coarsely(t.bytes, t.schema, level);
      ASSERT_TRUE(d.ok());
      EXPECT_LE(rms(t.cloud, *d), std::max(0.02, std::ldexp(4.0, -int(level)))) << codec_name(codec) << level;
    }
  }
}

TEST(TileLevels, FirstBytesAreEnough) {
  for (const auto& [name, cloud] : hard_clouds()) {
    const Tile t = tile_of(cloud, CodecId::surface, 0.01);
    const auto bytes = tile_level_bytes(t.bytes, t.schema);
    ASSERT_TRUE(bytes.ok()) << name;
    EXPECT_TRUE(std::is_sorted(bytes->begin(), bytes->end())) << name;
    EXPECT_LE(bytes->back(), t.bytes.size()) << name;
    for (unsigned level = 0; level < bytes->size(); ++level) {
      const auto some = decode_tile_coarsely(ByteSpan(t.bytes).subspan(0, (*bytes)[level]), t.schema, level);
      const auto all = decode_tile_coarsely(t.bytes, t.schema, level);
      ASSERT_TRUE(some.ok() && all.ok()) << name << " level " << level;
      EXPECT_EQ(some->xyz, all->xyz) << name << " level " << level;
    }
  }
}

TEST(TileLevels, LosslessComesInFull) {
  Tile t = tile_of(room(300, 1, 5), CodecId::points, 0.01);
  t.schema.promise = PromiseKind::lossless;
  TileSettings settings;
  settings.codec = CodecId::lossless;
  const auto e = encode_tile(t.cloud, t.schema, settings);
  ASSERT_TRUE(e.ok());
  EXPECT_EQ(*count_tile_levels(e->bytes, t.schema), 1u);
  EXPECT_EQ(decode_tile_coarsely(e->bytes, t.schema, 0)->size(), 300u);
}

TEST(TileLevels, DamagedBytes) {
  for (const CodecId codec : {CodecId::surface, CodecId::points}) {
    const Tile t = tile_of(room(300, 1, 4), codec, 0.01);
    const auto check = [&](const Bytes& bytes) {
      (void)tile_level_bytes(bytes, t.schema);
      for (const unsigned level : {0u, 3u, 6u}) {
        const auto d = decode_tile_coarsely(bytes, t.schema, level);
        if (d.ok()) {
          const auto header = read_tile_header(bytes);
          ASSERT_TRUE(header.ok());
          EXPECT_EQ(d->size(), header->points);
        }
      }
    };
    for (std::size_t i = 0; i < t.bytes.size(); ++i) {
      check(Bytes(t.bytes.begin(), t.bytes.begin() + std::ptrdiff_t(i)));
      for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
        Bytes damaged = t.bytes;
        damaged[i] ^= flip;
        check(damaged);
      }
    }
  }
}

}  // namespace
}  // namespace mapcodec::test
