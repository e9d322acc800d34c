// SPDX-License-Identifier: GPL-3.0-or-later
// The surface codec as a whole: what goes in comes out in number, near where it was, the same every time.
#include <gtest/gtest.h>

#include "mapcodec/quality/grid_nearest.hpp"

#include "mapcodec/codec/tile_codec.hpp"
#include "mapcodec/quality/evaluation.hpp"
#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

TEST(SurfaceCodec, GivesWhatTheEncoderSaidOfEveryCloud) {
  for (const auto& [name, cloud] : hard_clouds()) {
    for (const double step : {0.001, 0.01, 0.2}) {
      const auto e = encode_surface(cloud, steps_of(step), {});
      ASSERT_TRUE(e.ok()) << name << ": " << e.error().message;
      ASSERT_EQ(e->decoded.size(), cloud.size()) << name;
      const auto d = decode_surface(e->bytes, cloud.size(), steps_of(step), {});
      ASSERT_TRUE(d.ok()) << name << ": " << d.error().message;
      EXPECT_EQ(d->xyz, e->decoded) << name;
      EXPECT_TRUE(d->voxels.empty()) << name;
    }
  }
}

TEST(SurfaceCodec, ErrorFollowsTheStep) {
  SerialRunner serial;
  EvaluationSettings settings;
  settings.with_normals = false;
  for (const auto& [name, cloud] : hard_clouds()) {
    for (const double step : {0.002, 0.02}) {
      const auto e = encode_surface(cloud, steps_of(step), {});
      ASSERT_TRUE(e.ok());
      PointCloud original, decoded;
      original.xyz = cloud;
      decoded.xyz = e->decoded;
      const auto error = evaluate(original, decoded, serial, settings);
      ASSERT_TRUE(error.ok());
      EXPECT_LT(error->rms_m, 4 * step) << name << " step " << step;
    }
  }
}

TEST(SurfaceCodec, IsDeterministic) {
  const Cloud cloud = room(3000, 1.5, 9);
  EXPECT_EQ(encode_surface(cloud, steps_of(0.01), {})->bytes,
            encode_surface(cloud, steps_of(0.01), {})->bytes);
}

TEST(SurfaceCodec, PlaneTakesFewBytes) {
  const auto e = encode_surface(patch(200, 0.005), steps_of(0.01), {});
  ASSERT_TRUE(e.ok());
  EXPECT_LT(e->bytes.size(), 100u);  // 40000 points
}

TEST(SurfaceCodec, FloatMapsGetFloats) {
  const Cloud cloud = moved(room(2000, 1, 3), {100, 200, 3});
  const Quantizer lattice = steps_of(0.01, CoordinateFormat::Kind::f32);
  const auto e = encode_surface(cloud, lattice, {});
  ASSERT_TRUE(e.ok());
  for (const Vec3& p : e->decoded) {
    for (const double v : p) EXPECT_EQ(v, static_cast<double>(static_cast<float>(v)));
  }
  EXPECT_EQ(decode_surface(e->bytes, cloud.size(), lattice, {})->xyz, e->decoded);
}

TEST(SurfaceCodec, RefusesWhatHasNoSurface) {
  EXPECT_EQ(encode_surface({}, steps_of(0.01), {}).error().code, ErrorCode::kEmpty);
  const Cloud nan{{0, 0, 0}, {1, std::nan(""), 0}};
  EXPECT_EQ(encode_surface(nan, steps_of(0.01), {}).error().code, ErrorCode::kInvalidArgument);
  const Cloud wide{{0, 0, 0}, {1e9, 0, 0}};
  EXPECT_EQ(encode_surface(wide, steps_of(0.01), {}).error().code, ErrorCode::kInvalidArgument);
  const Cloud one{{0, 0, 0}};
  for (const double step : {0.0, -1.0, std::nan("")}) {
    EXPECT_EQ(encode_surface(one, steps_of(step), {}).error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(SurfaceCodec, RefusesATradeOutOfRange) {
  const Cloud one{{0, 0, 0}};
  for (const SurfaceTrade& trade :
       {SurfaceTrade{0, 0.3}, SurfaceTrade{-1, 0.3}, SurfaceTrade{std::nan(""), 0.3}, SurfaceTrade{1, 0},
        SurfaceTrade{1, 1}, SurfaceTrade{1, std::nan("")}}) {
    EXPECT_EQ(encode_surface(one, steps_of(0.01), {Effort::standard, {}, trade}).error().code,
              ErrorCode::kInvalidArgument);
  }
}

TEST(SurfaceCodec, LowerPricesBuyLessError) {
  const Cloud cloud = room(20000, 3, 5);
  std::size_t last_bytes = 0;
  double last_error = 1e9;
  for (const double price : {4.0, 1.0, 0.25}) {
    const auto e = encode_surface(cloud, steps_of(0.02), {Effort::standard, {}, {price, 0.3}});
    ASSERT_TRUE(e.ok());
    EXPECT_EQ(decode_surface(e->bytes, cloud.size(), steps_of(0.02), {})->xyz, e->decoded);
    const NearestPair near = find_nearest_pair(cloud, e->decoded);
    double error = 0;
    for (const Nearest* n : {&near.forth, &near.back}) {
      for (const double s : n->squared) error += s;
    }
    EXPECT_GT(e->bytes.size(), last_bytes);
    EXPECT_LT(error, last_error);
    last_bytes = e->bytes.size();
    last_error = error;
  }
}

TEST(SurfaceCodec, VoxelsAreSortedAndHoldTheirPoints) {
  const Cloud cloud = room(3000, 1.5, 9);
  auto e = encode_surface(cloud, steps_of(0.01), {});
  ASSERT_TRUE(e.ok());
  for (const std::uint8_t shift : {surface::least_voxel_shift(e->header.depth), std::uint8_t{7},
                                   surface::most_voxel_shift(e->header.depth)}) {
    const surface::VoxelOrder sorted = set_voxels(*e, shift);
    const auto d = decode_surface(e->bytes, cloud.size(), steps_of(0.01), {});
    ASSERT_TRUE(d.ok());
    EXPECT_EQ(d->voxels, sorted.voxels);
    for (std::size_t i = 0; i < cloud.size(); ++i) ASSERT_EQ(d->xyz[i], e->decoded[sorted.order[i]]);
  }
}

TEST(SurfaceCodec, FewerLevelsGiveAsManyPoints) {
  const Cloud cloud = room(3000, 1.5, 9);
  const auto e = encode_surface(cloud, steps_of(0.004), {});
  ASSERT_TRUE(e.ok());
  for (const unsigned levels : {0u, 1u, 5u, 12u, 40u}) {
    const auto d = decode_surface(e->bytes, cloud.size(), steps_of(0.004), {}, levels);
    ASSERT_TRUE(d.ok()) << levels;
    EXPECT_EQ(d->xyz.size(), cloud.size());
  }
}

PointCloud colored(const Cloud& xyz) {
  PointCloud c;
  c.coordinates.kind = CoordinateFormat::Kind::f64;
  c.xyz = xyz;
  c.channels = {{{"rgb", ScalarType::u8, 3}, {}},
                {{"intensity", ScalarType::f32, 1}, {}},
                {{"time", ScalarType::f64, 1}, {}}};
  c.resize(xyz.size());
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      c.channels[0].at(i)[k] =
          static_cast<std::uint8_t>(128 + 100 * std::sin(3 * xyz[i][k] + 2 * xyz[i][0]) + i % 5);
    }
    c.channels[1].set<float>(i, static_cast<float>(xyz[i][0] > 0.5 ? 7 : 11));
  }
  return c;
}

MapSchema schema_of(const PointCloud& c, double step, double color_bound) {
  MapSchema s;
  s.promise = PromiseKind::rms;
  s.promise_value = step;
  s.step_m = step;
  s.coordinates = c.coordinates;
  s.channels = {{c.channels[0].info, ChannelKept::bounded, color_bound, {}},
                {c.channels[1].info, ChannelKept::exact, 0, {}},
                {c.channels[2].info, ChannelKept::dropped, 0, {}}};
  return s;
}

TEST(SurfaceTile, RoughErrorsChangeNoByte) {
  const PointCloud cloud = colored(room(40000, 3, 1));
  MapSchema schema = schema_of(cloud, 0.03, 8);
  for (const CodecId codec : {CodecId::surface, CodecId::points}) {
    TileSettings tile;
    tile.codec = codec;
    for (const bool with_channels : {true, false}) {
      tile.rough_errors = false;
      const auto exact = encode_tile(cloud, schema, tile);
      tile.rough_errors = true;
      const auto rough = encode_tile(cloud, schema, tile);
      ASSERT_TRUE(exact.ok() && rough.ok());
      EXPECT_EQ(exact->bytes, rough->bytes);
      EXPECT_NEAR(rough->errors.rms_m / exact->errors.rms_m, 1, 0.03);
      EXPECT_EQ(rough->errors.color_error, exact->errors.color_error) << with_channels;
      for (ChannelSchema& c : schema.channels) c.kept = ChannelKept::dropped;
    }
    schema = schema_of(cloud, 0.03, 8);
  }
}

TEST(SurfaceTile, MeasuresWhatItsDecoderGives) {
  SerialRunner serial;
  EvaluationSettings settings;
  settings.with_normals = false;
  for (const auto& [name, xyz] : hard_clouds()) {
    const PointCloud cloud = colored(xyz);
    const MapSchema schema = schema_of(cloud, 0.02, 8);
    TileSettings tile;
    tile.codec = CodecId::surface;
    const auto e = encode_tile(cloud, schema, tile);
    ASSERT_TRUE(e.ok()) << name << ": " << e.error().message;
    const auto d = decode_tile(e->bytes, schema);
    ASSERT_TRUE(d.ok()) << name << ": " << d.error().message;
    ASSERT_EQ(d->size(), cloud.size());
    ASSERT_EQ(d->channels.size(), 2u);
    const auto measured = evaluate(cloud, *d, serial, settings);
    ASSERT_TRUE(measured.ok());
    EXPECT_NEAR(e->rms_forward_m, measured->rms_ab_m, 1e-12) << name;
    EXPECT_NEAR(e->rms_backward_m, measured->rms_ba_m, 1e-12) << name;
    EXPECT_GE(e->errors.max_axis_error_m, measured->max_axis_error_m - 1e-12) << name;
    EXPECT_NEAR(e->errors.density_error, measured->density_error, 1e-9) << name;
    // Of equally near neighbours of different colours the evaluation takes any, the tile the mean over them:
    // where all points are equal the two measures have nothing in common but the bound.
    if (std::string(name) != "equal") {
      EXPECT_NEAR(e->errors.color_error, measured->color_error, 0.5 + 0.1 * measured->color_error) << name;
    }
    EXPECT_LE(e->errors.color_error, 8) << name;
    for (std::size_t i = 0; i < d->size(); ++i) {
      const float v = d->channels[1].get<float>(i);
      ASSERT_TRUE(v == 7 || v == 11) << name;
    }
  }
}

TEST(SurfaceTile, ColorMeetsItsBound) {
  const PointCloud cloud = colored(room(4000, 2, 5));
  double last = 1e9;
  for (const double bound : {6.0, 12.0, 25.0}) {
    const MapSchema schema = schema_of(cloud, 0.02, bound);
    TileSettings tile;
    tile.codec = CodecId::surface;
    const auto e = encode_tile(cloud, schema, tile);
    ASSERT_TRUE(e.ok());
    EXPECT_LE(e->errors.color_error, bound);
    EXPECT_GE(e->errors.color_error, 0.95 * bound);
    EXPECT_LT(static_cast<double>(e->bytes.size()), last);
    last = static_cast<double>(e->bytes.size());
  }
}

TEST(SurfaceTile, OwnStepTravelsWithTheTile) {
  const PointCloud cloud = colored(room(2000, 1, 5));
  const MapSchema schema = schema_of(cloud, 0.05, 8);
  for (const CodecId codec : {CodecId::surface, CodecId::points}) {
    TileSettings tile;
    tile.codec = codec;
    tile.step_m = 0.003;
    const auto e = encode_tile(cloud, schema, tile);
    ASSERT_TRUE(e.ok());
    const auto d = decode_tile(e->bytes, schema);
    ASSERT_TRUE(d.ok());
    EXPECT_LT(e->errors.rms_m, 0.012);
    EXPECT_EQ(d->size(), cloud.size());
  }
}

}  // namespace
}  // namespace mapcodec::test
