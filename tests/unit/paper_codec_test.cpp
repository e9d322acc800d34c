// SPDX-License-Identifier: GPL-3.0-or-later
// The `paper` codec from points to points.
#include <gtest/gtest.h>

#include <limits>

#include "mapcodec/codec/paper_decoder.hpp"
#include "tests/unit/paper_support.hpp"

namespace mapcodec {
namespace {

using test::make_room;
using test::schema_of;
using test::small_settings;

PointCloud round_trip(const PointCloud& cloud, const PaperSettings& settings) {
  const MapSchema schema = schema_of(cloud);
  const auto encoded = encode_paper(cloud, schema, settings);
  EXPECT_TRUE(encoded.ok()) << (encoded.ok() ? "" : encoded.error().to_string());
  if (!encoded) return {};
  EXPECT_EQ(encoded->points, cloud.size());
  auto decoded = decode_paper(encoded->bytes, encoded->points, schema);
  EXPECT_TRUE(decoded.ok()) << (decoded.ok() ? "" : decoded.error().to_string());
  if (!decoded) return {};
  EXPECT_EQ(decoded->size(), cloud.size());
  EXPECT_EQ(decoded->channels.size(), cloud.channels.size());
  for (std::size_t c = 0; c < decoded->channels.size(); ++c)
    EXPECT_EQ(decoded->channels[c].size(), cloud.size());
  return std::move(decoded).value();
}

/// Share of the points on the floor of make_room, and how far they are from it at most.
std::pair<double, double> floor_share(const PointCloud& cloud, double z) {
  double count = 0, most = 0;
  for (const Vec3& p : cloud.xyz) {
    if (p[2] - z > 0.1) continue;
    ++count;
    most = std::max(most, std::abs(p[2] - z));
  }
  return {count / static_cast<double>(cloud.size()), most};
}

class PaperForms : public testing::TestWithParam<bool> {};

TEST_P(PaperForms, KeepsTheRoom) {
  PaperSettings settings = small_settings(GetParam());
  settings.outside_density =
      0.2;  // the published rule alone, with relArea 1, lets stray points fill the hole
  for (const Vec3& at : {Vec3{0, 0, 0}, Vec3{-7.3, 4.1, -2}, Vec3{1e6, 5e6, 100}}) {
    const PointCloud room = make_room(20000, at);
    const PointCloud decoded = round_trip(room, settings);
    const auto [original_share, ignored] = floor_share(room, at[2]);
    const auto [share, height] = floor_share(decoded, at[2]);
    EXPECT_NEAR(share, original_share, 0.02);
    EXPECT_LT(height, 0.1);
    std::size_t in_hole = 0;
    for (const Vec3& p : decoded.xyz) {
      in_hole += std::hypot(p[0] - at[0] - 1.5, p[1] - at[1] - 1) < 0.35 && p[2] - at[2] < 0.02;
      for (std::size_t d = 0; d < 3; ++d) EXPECT_LT(std::abs(p[d] - at[d] - 1.5), 1.8);
    }
    EXPECT_LT(in_hole, 20u);
  }
}

TEST_P(PaperForms, RelAreaOfThePaperKeepsAHoleEmpty) {
  PaperSettings settings = small_settings(GetParam());
  settings.rel_area = 200;  // of a cloud with some 700 points per square metre
  const PointCloud decoded = round_trip(make_room(20000, {0, 0, 0}), settings);
  std::size_t in_hole = 0;
  for (const Vec3& p : decoded.xyz) in_hole += std::hypot(p[0] - 1.5, p[1] - 1) < 0.35 && p[2] < 0.02;
  EXPECT_LT(in_hole, 20u);
}

TEST_P(PaperForms, KeepsColorsOfClusters) {
  const PointCloud room = make_room(20000);
  PaperSettings settings = small_settings(GetParam());
  settings.clusters = 2;
  const PointCloud decoded = round_trip(room, settings);
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < decoded.size(); ++i) {
    const bool red = decoded.channels[0].get<std::uint8_t>(i, 0) > 100;
    wrong += red != (decoded.xyz[i][0] < 1.5) && std::abs(decoded.xyz[i][0] - 1.5) > 0.05;
  }
  EXPECT_LT(wrong, 200u);
}

TEST_P(PaperForms, SameBytesAndPointsTwice) {
  const PointCloud room = make_room(6000);
  PaperSettings settings = small_settings(GetParam());
  settings.clusters = 4;
  const MapSchema schema = schema_of(room);
  const auto a = encode_paper(room, schema, settings), b = encode_paper(room, schema, settings);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->bytes, b->bytes);
  EXPECT_EQ(decode_paper(a->bytes, a->points, schema)->xyz, decode_paper(b->bytes, b->points, schema)->xyz);
}

TEST_P(PaperForms, OtherLayouts) {
  for (const std::uint32_t clusters : {1u, 3u}) {
    PaperSettings settings = small_settings(GetParam());
    settings.clusters = clusters;
    round_trip(make_room(3000, {0, 0, 0}, false), settings);
    round_trip(make_room(3000, {0, 0, 0}, true, ScalarType::u16), settings);
  }
}

TEST_P(PaperForms, EdgesOfInput) {
  std::vector<std::vector<Vec3>> clouds{{{1, 2, 3}}, std::vector<Vec3>(300, Vec3{5, 5, 5}), {}, {}, {}};
  for (int i = 0; i < 300; ++i) clouds[2].push_back({0.01 * i, 0.02 * i, 0});
  for (int i = 0; i < 300; ++i) clouds[3].push_back({0.01 * (i % 20), 0.01 * (i / 20), 0});
  SplitMix random(1);
  for (int i = 0; i < 300; ++i)
    clouds[4].push_back({test::unit(random), test::unit(random), test::unit(random)});
  for (const std::vector<Vec3>& xyz : clouds) {
    PointCloud cloud;
    cloud.xyz = xyz;
    for (const double perc : {0.0, 1.0}) {
      PaperSettings settings = small_settings(GetParam());
      settings.perc_process = perc;
      settings.min_points = 0;
      round_trip(cloud, settings);
    }
  }
}

TEST_P(PaperForms, DamageIsAnErrorOrTheRightSize) {
  const PointCloud room = make_room(500);
  PaperSettings settings = small_settings(GetParam());
  settings.clusters = 3;
  const MapSchema schema = schema_of(room);
  const auto encoded = encode_paper(room, schema, settings);
  ASSERT_TRUE(encoded.ok());
  const auto check = [&](ByteSpan bytes) {
    const auto decoded = decode_paper(bytes, encoded->points, schema);
    if (decoded) {
      EXPECT_EQ(decoded->size(), room.size());
    }
    const auto patches = read_paper_patches(bytes, encoded->points, schema);
    if (patches) {
      EXPECT_LE(patches->size(), room.size());
    }
  };
  for (std::size_t n = 0; n < encoded->bytes.size(); ++n) check(ByteSpan(encoded->bytes).first(n));
  for (std::size_t i = 0; i < encoded->bytes.size(); ++i) {
    for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
      Bytes damaged = encoded->bytes;
      damaged[i] ^= flip;
      check(damaged);
    }
  }
  for (const std::uint64_t count : {0ull, 1ull, 499ull, 501ull, 1ull << 27}) {
    const auto decoded = decode_paper(encoded->bytes, count, schema);
    if (decoded) {
      EXPECT_EQ(decoded->size(), count);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(BothForms, PaperForms, testing::Values(false, true),
                         [](const auto& form) { return form.param ? "Raw" : "Coded"; });

TEST(Paper, CodedIsAThirdOfRawAndLess) {
  const PointCloud room = make_room(30000);
  PaperSettings settings = small_settings();
  settings.clusters = 3;
  const auto coded = encode_paper(room, schema_of(room), settings);
  settings.raw = true;
  const auto raw = encode_paper(room, schema_of(room), settings);
  ASSERT_TRUE(coded.ok() && raw.ok());
  EXPECT_LT(3 * coded->bytes.size(), raw->bytes.size());
  EXPECT_LT(3 * coded->stats.plane_bytes, raw->stats.plane_bytes);
  EXPECT_LE(coded->geometry_bytes, coded->bytes.size());
}

TEST(Paper, PatchesTellWhatTheTileHolds) {
  const PointCloud room = make_room(20000, {1e6, 5e6, 100});
  const MapSchema schema = schema_of(room);
  for (const bool raw : {false, true}) {
    const auto encoded = encode_paper(room, schema, small_settings(raw));
    ASSERT_TRUE(encoded.ok());
    const auto patches = read_paper_patches(encoded->bytes, encoded->points, schema);
    ASSERT_TRUE(patches.ok());
    ASSERT_EQ(patches->size(), encoded->stats.planes);
    ASSERT_GE(patches->size(), 2u);
    std::uint64_t on_planes = 0, triangles = 0;
    for (const PlanarPatch& patch : *patches) {
      std::uint64_t points = 0;
      for (const PatchTriangle& t : patch.triangles) points += t.points;
      EXPECT_EQ(points, patch.points);
      on_planes += points;
      triangles += patch.triangles.size();
      for (const Vec3& v : patch.vertices) {
        EXPECT_NEAR(patch.normal[0] * v[0] + patch.normal[1] * v[1] + patch.normal[2] * v[2], patch.offset_m,
                    1e-3);
      }
    }
    EXPECT_EQ(on_planes + encoded->stats.leftover_points, encoded->points);
    EXPECT_EQ(triangles, encoded->stats.triangles);
    EXPECT_NEAR(std::abs((*patches)[0].normal[2]), 1, 1e-2);
    EXPECT_NEAR((*patches)[0].area_m2, 6 - 0.785, 0.35);
  }
}

TEST(Paper, ConstantsAreFilledIn) {
  PointCloud room = make_room(2000, {0, 0, 0}, false);
  room.channels.push_back({{"label", ScalarType::u16, 1}, Bytes(4000)});
  MapSchema schema = schema_of(room);
  schema.channels[0].kept = ChannelKept::constant;
  schema.channels[0].constant = {7, 1};
  const auto encoded = encode_paper(room, schema, small_settings());
  ASSERT_TRUE(encoded.ok());
  const auto decoded = decode_paper(encoded->bytes, encoded->points, schema);
  ASSERT_TRUE(decoded.ok());
  for (std::size_t i = 0; i < decoded->size(); ++i)
    EXPECT_EQ(decoded->channels[0].get<std::uint16_t>(i), 263);
}

TEST(Paper, RefusesWhatItCannotKeep) {
  PointCloud room = make_room(200);
  const auto code = [](const PointCloud& cloud, const MapSchema& schema, const PaperSettings& settings) {
    const auto r = encode_paper(cloud, schema, settings);
    return r.ok() ? ErrorCode::kNotFound : r.error().code;
  };
  EXPECT_EQ(code(PointCloud{}, MapSchema{}, {}), ErrorCode::kInvalidArgument);
  MapSchema schema = schema_of(room);
  PointCloud broken = room;
  broken.xyz[7][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(code(broken, schema, {}), ErrorCode::kInvalidArgument);
  PointCloud vast = room;
  vast.xyz[7][1] = 1e12;
  EXPECT_EQ(code(vast, schema, {}), ErrorCode::kInvalidArgument);
  schema.channels[0].info.name = "normal";
  EXPECT_EQ(code(room, schema, {}), ErrorCode::kInvalidArgument);
  schema = schema_of(room);
  for (double PaperSettings::*field :
       {&PaperSettings::distance_m, &PaperSettings::alpha_m, &PaperSettings::leftover_step_m}) {
    PaperSettings settings;
    settings.*field = 0;
    EXPECT_EQ(code(room, schema, settings), ErrorCode::kInvalidArgument);
  }
}

TEST(Paper, LimitsHold) {
  const PointCloud room = make_room(2000);
  const MapSchema schema = schema_of(room);
  const auto encoded = encode_paper(room, schema, small_settings());
  ASSERT_TRUE(encoded.ok());
  DecodeLimits limits;
  limits.max_points = 1999;
  const auto decoded = decode_paper(encoded->bytes, encoded->points, schema, limits);
  ASSERT_FALSE(decoded.ok());
  EXPECT_EQ(decoded.error().code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace mapcodec
