// SPDX-License-Identifier: GPL-3.0-or-later
// The surfaces of a tile themselves: that its points lie on them, and that no bytes break their reader.
#include "mapcodec/codec/surface_patches.hpp"

#include <gtest/gtest.h>

#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/codec/tile_patches.hpp"
#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

double along(const Vec3& a, const Vec3& b, const Vec3& n) {
  return (a[0] - b[0]) * n[0] + (a[1] - b[1]) * n[1] + (a[2] - b[2]) * n[2];
}

std::uint64_t points_on(const std::vector<SurfacePatch>& patches) {
  std::uint64_t sum = 0;
  for (const SurfacePatch& p : patches) sum += p.points;
  return sum;
}

SurfaceEncoding encoded(const Cloud& cloud, double step) {
  auto e = encode_surface(cloud, steps_of(step), {});
  EXPECT_TRUE(e.ok());
  (void)set_voxels(*e, surface::least_voxel_shift(e->header.depth));
  return std::move(e).value();
}

TEST(SurfacePatches, EveryPointLiesOnItsPatch) {
  for (const auto& [name, cloud] : hard_clouds()) {
    for (const double step : {0.003, 0.02}) {
      const SurfaceEncoding e = encoded(cloud, step);
      const auto points = decode_surface(e.bytes, cloud.size(), steps_of(step), {});
      const auto patches = read_surface_patch_points(e.bytes, cloud.size(), steps_of(step));
      ASSERT_TRUE(points.ok() && patches.ok()) << name;
      ASSERT_EQ(patches->patch_of.size(), cloud.size());
      EXPECT_EQ(patches->voxels, points->voxels) << name;
      std::size_t on_patches = 0, flat = 0;
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        if (patches->patch_of[i] == kNoPatch) continue;
        const SurfacePatch& p = patches->patches[patches->patch_of[i]];
        const double off = std::abs(along(points->xyz[i], p.center, p.normal)) - 1.8 * p.noise_m;
        // The lattice of points is a 512th of the step; at 1e6 m a double has 1e-10 m. Near the next patch
        // surfaces bend.
        flat += off <= step / 50 + 1e-8;
        ++on_patches;
        EXPECT_LE(off, 2 * step) << name;
      }
      EXPECT_GE(2 * flat, on_patches) << name;
      EXPECT_LE(points_on(patches->patches), cloud.size()) << name;
    }
  }
}

TEST(SurfacePatches, AreFlatConvexAndMeasured) {
  const SurfaceEncoding e = encoded(room(4000, 2, 5), 0.01);
  const auto patches = read_surface_patches(e.bytes, 4000, steps_of(0.01));
  ASSERT_TRUE(patches.ok());
  ASSERT_FALSE(patches->empty());
  for (const SurfacePatch& p : *patches) {
    EXPECT_GE(p.polygon.size(), 3u);
    EXPECT_GT(p.area_m2, 0);
    EXPECT_GT(p.points, 0u);
    EXPECT_FALSE(p.colored);
    EXPECT_NEAR(along(p.normal, {0, 0, 0}, p.normal), 1, 1e-9);
    for (const Vec3& corner : p.polygon) EXPECT_NEAR(along(corner, p.center, p.normal), 0, 1e-4);
  }
}

TEST(SurfacePatches, APlaneIsOneOrFew) {
  const SurfaceEncoding e = encoded(patch(100, 0.01), 0.02);
  const auto patches = read_surface_patches(e.bytes, 10000, steps_of(0.02));
  ASSERT_TRUE(patches.ok());
  EXPECT_LE(patches->size(), 8u);
  EXPECT_EQ(points_on(*patches), 10000u);
  double area = 0;
  for (const SurfacePatch& p : *patches) {
    area += p.area_m2;
    EXPECT_GT(std::abs(p.normal[2]), 0.99);
  }
  EXPECT_NEAR(area, 1, 0.15);
}

TEST(SurfacePatches, DamagedBytes) {
  const SurfaceEncoding e = encoded(room(400, 1, 4), 0.01);
  const auto check = [](const Bytes& bytes) {
    const auto patches = read_surface_patches(bytes, 400, steps_of(0.01));
    if (patches.ok()) {
      EXPECT_LE(points_on(*patches), 400u);
    }
    const auto points = read_surface_patch_points(bytes, 400, steps_of(0.01));
    if (points.ok()) {
      EXPECT_EQ(points->patch_of.size(), 400u);
    }
  };
  for (std::size_t i = 0; i < e.bytes.size(); ++i) {
    check(Bytes(e.bytes.begin(), e.bytes.begin() + std::ptrdiff_t(i)));
    for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
      Bytes damaged = e.bytes;
      damaged[i] ^= flip;
      check(damaged);
    }
  }
}

TEST(SurfacePatches, LimitsAndEmptyTiles) {
  const SurfaceEncoding e = encoded(patch(30, 0.01), 0.01);
  EXPECT_EQ(read_surface_patches(e.bytes, 0, steps_of(0.01)).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(read_surface_patches(e.bytes, 1u << 30, steps_of(0.01)).error().code, ErrorCode::kLimitExceeded);
  EXPECT_EQ(read_surface_patches(e.bytes, 900, steps_of(0)).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(read_surface_patches({}, 900, steps_of(0.01)).error().code, ErrorCode::kTruncated);
}

MapSchema schema_of(double step) {
  MapSchema s;
  s.promise = PromiseKind::rms;
  s.promise_value = step;
  s.tile_size_m = 4;
  s.step_m = step;
  s.coordinates.kind = CoordinateFormat::Kind::f64;
  return s;
}

TEST(TilePatches, OtherCodecsHaveNone) {
  PointCloud cloud;
  cloud.coordinates.kind = CoordinateFormat::Kind::f64;
  cloud.xyz = room(500, 1, 1);
  const MapSchema schema = schema_of(0.01);
  TileSettings settings;
  settings.codec = CodecId::points;
  const auto tile = encode_tile(cloud, schema, settings);
  ASSERT_TRUE(tile.ok());
  const auto patches = read_tile_patches(tile->bytes, schema);
  ASSERT_TRUE(patches.ok());
  EXPECT_FALSE(patches->surfaces);
  EXPECT_EQ(patches->points, 500u);
  EXPECT_TRUE(patches->patches.empty());
}

TEST(TilePatches, ColorsAreMeansOfTheirPoints) {
  MapSchema schema = schema_of(0.01);
  ChannelSchema rgb;
  rgb.info = {"rgb", ScalarType::u8, 3};
  rgb.kept = ChannelKept::bounded;
  rgb.bound = 4;
  schema.channels = {rgb};
  PointCloud cloud = schema.layout();
  cloud.xyz = patch(60, 0.01);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (const std::uint8_t c : {200, 100, 50}) cloud.channels[0].data.push_back(c);
  }
  TileSettings settings;
  settings.codec = CodecId::surface;
  const auto tile = encode_tile(cloud, schema, settings);
  ASSERT_TRUE(tile.ok()) << tile.error().message;
  const auto patches = read_tile_patches(tile->bytes, schema);
  ASSERT_TRUE(patches.ok()) << patches.error().message;
  ASSERT_TRUE(patches->surfaces);
  ASSERT_FALSE(patches->patches.empty());
  for (const SurfacePatch& p : patches->patches) {
    ASSERT_TRUE(p.colored);
    EXPECT_NEAR(p.rgb[0], 200, 8);
    EXPECT_NEAR(p.rgb[1], 100, 8);
    EXPECT_NEAR(p.rgb[2], 50, 8);
  }
}

}  // namespace
}  // namespace mapcodec::test
