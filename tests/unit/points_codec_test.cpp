// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/codec/points_encoder.hpp"
#include "tests/unit/points_support.hpp"

namespace mapcodec {
namespace {

using test::Cloud;
constexpr auto kF32 = CoordinateFormat::Kind::f32;
constexpr auto kF64 = CoordinateFormat::Kind::f64;
constexpr Effort kEfforts[] = {Effort::fast, Effort::standard, Effort::high};

void expect_bound(const Cloud& cloud, const PointsEncoding& encoded, const Quantizer& quantizer) {
  Vec3 most{};
  for (std::size_t i = 0; i < encoded.order.size(); ++i) {
    const Vec3& p = cloud[encoded.order[i]];
    for (std::size_t d = 0; d < 3; ++d) most[d] = std::max(most[d], std::abs(p[d] - encoded.decoded[i][d]));
  }
  for (const double m : most)
    EXPECT_LE(m, quantizer.step_m / 2 * (1 + 1e-9) + (quantizer.kind == kF32 ? 1e-5 : 0));
}

PointsEncoding round_trip(const Cloud& cloud, const Quantizer& quantizer, const PointsSettings& settings) {
  auto encoded = encode_points(cloud, quantizer, settings);
  EXPECT_TRUE(encoded.ok()) << encoded.error().to_string();
  const auto decoded = decode_points(encoded->bytes, encoded->decoded.size(), quantizer, {});
  EXPECT_TRUE(decoded.ok()) << decoded.error().to_string();
  if (!decoded) return {};
  EXPECT_EQ(decoded->xyz, encoded->decoded);
  EXPECT_EQ(decoded->voxels, encoded->voxels);
  expect_bound(cloud, *encoded, quantizer);
  return std::move(encoded).value();
}

void round_trip_all(const Cloud& cloud, const Quantizer& quantizer) {
  for (const Effort effort : kEfforts) {
    const PointsEncoding all = round_trip(cloud, quantizer, {effort, true});
    EXPECT_EQ(all.decoded.size(), cloud.size());
    const PointsEncoding merged = round_trip(cloud, quantizer, {effort, false});
    EXPECT_LE(merged.decoded.size(), cloud.size());
    EXPECT_EQ(std::adjacent_find(merged.voxels.begin(), merged.voxels.end()), merged.voxels.end());
  }
}

TEST(PointsCodec, OnePoint) {
  round_trip_all({{1.25, -3.5, 7}}, {{0, 0, 0}, 0.01, kF32});
}

TEST(PointsCodec, AllEqual) {
  for (const std::size_t n : {2u, 17u, 4097u})
    round_trip_all(Cloud(n, Vec3{0.1, 0.2, 0.3}), {{0, 0, 0}, 0.01, kF64});
}

TEST(PointsCodec, Collinear) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Cloud cloud(1000, Vec3{1, 1, 1});
    for (std::size_t i = 0; i < cloud.size(); ++i) cloud[i][axis] = 0.003 * static_cast<double>(i);
    round_trip_all(cloud, {{0, 0, 0}, 0.01, kF64});
  }
}

TEST(PointsCodec, FullBlock) {
  Cloud cloud;
  for (int i = 0; i < 32 * 32 * 32; ++i) cloud.push_back({0.5 + i % 32, 0.5 + i / 32 % 32, 0.5 + i / 1024});
  round_trip_all(cloud, {{0, 0, 0}, 1, kF64});
  EXPECT_LT(round_trip(cloud, {{0, 0, 0}, 1, kF64}, {Effort::standard, true}).bytes.size(), 600u);
}

TEST(PointsCodec, DenseAndSparseClouds) {
  round_trip_all(test::room(20000, 2, 1), {{0, 0, 0}, 0.01, kF32});
  round_trip_all(test::room(20000, 0.2, 2), {{0, 0, 0}, 0.01, kF32});
  round_trip_all(test::sparse(3000, 50, 3), {{-7, 1, 2}, 0.002, kF64});
}

TEST(PointsCodec, HugeCountsBesideSingleOnes) {
  Cloud cloud = test::room(500, 1, 4);
  for (const std::size_t n : {9000u, 300u, 40u}) cloud.insert(cloud.end(), n, Vec3{cloud[n % 500]});
  round_trip_all(cloud, {{0, 0, 0}, 0.02, kF64});
}

TEST(PointsCodec, FarFromTheOrigin) {
  const Cloud cloud = test::moved(test::room(5000, 2, 5), {1e6, -5e6, 100});
  round_trip_all(cloud, {{0, 0, 0}, 0.002, kF64});
  round_trip_all(cloud, {{1e6, -5e6, 0}, 0.002, kF64});
}

TEST(PointsCodec, DeepestOctree) {
  const double step = 0.001;
  const double most = step * ((1 << 21) - 1);
  round_trip_all({{0, 0, 0}, {most, most, most}, {step, most, 0}, {most, 0, 5}},
                 {{-step / 2, -step / 2, -step / 2}, step, kF64});
}

TEST(PointsCodec, OnCellBorders) {
  Cloud cloud;
  for (int i = -500; i < 500; ++i) cloud.push_back({i * 0.1, i * 0.01, i * 0.07});
  round_trip_all(cloud, {{0, 0, 0}, 0.01, kF64});
}

TEST(PointsCodec, ReportsItsErrors) {
  const Cloud cloud = test::room(3000, 2, 6);
  const Quantizer quantizer{{0, 0, 0}, 0.05, kF32};
  const PointsEncoding e = round_trip(cloud, quantizer, {});
  double sum = 0, most = 0;
  for (std::size_t i = 0; i < e.order.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      const double off = cloud[e.order[i]][d] - e.decoded[i][d];
      sum += off * off;
      most = std::max(most, std::abs(off));
    }
  }
  EXPECT_NEAR(e.sum_squared_error, sum, 1e-9);
  EXPECT_DOUBLE_EQ(e.max_axis_error_m, most);
}

TEST(PointsCodec, Float32CentresAreFloat32) {
  const PointsEncoding e = round_trip(test::room(500, 2, 7), {{0.1, 0.2, 0.3}, 0.003, kF32}, {});
  for (const Vec3& p : e.decoded) {
    for (const double x : p) EXPECT_EQ(x, static_cast<double>(static_cast<float>(x)));
  }
}

TEST(PointsCodec, EncodingTwiceGivesTheSameBytes) {
  const Cloud cloud = test::room(8000, 2, 8);
  const Quantizer quantizer{{0.5, -1, 0}, 0.01, kF32};
  for (const Effort effort : kEfforts) {
    const PointsEncoding first = round_trip(cloud, quantizer, {effort, true});
    EXPECT_EQ(round_trip(cloud, quantizer, {effort, true}).bytes, first.bytes);
    const PointsEncoding again = round_trip(first.decoded, quantizer, {effort, true});
    EXPECT_EQ(again.bytes, first.bytes) << "decode and encode again must change nothing";
    EXPECT_EQ(again.decoded, first.decoded);
  }
}

TEST(PointsCodec, OrderOfTheInputDoesNotMatter) {
  Cloud cloud = test::room(4000, 2, 9);
  const Quantizer quantizer{{0, 0, 0}, 0.01, kF32};
  const PointsEncoding first = round_trip(cloud, quantizer, {});
  std::reverse(cloud.begin(), cloud.end());
  EXPECT_EQ(round_trip(cloud, quantizer, {}).bytes, first.bytes);
}

TEST(PointsCodec, HighIsNeverLarger) {
  for (const Cloud& cloud : {test::room(300, 1, 10), test::room(20000, 1, 11), test::sparse(200, 9, 12),
                             Cloud(900, Vec3{1, 2, 3})}) {
    const Quantizer quantizer{{0, 0, 0}, 0.01, kF32};
    EXPECT_LE(round_trip(cloud, quantizer, {Effort::high, true}).bytes.size(),
              round_trip(cloud, quantizer, {Effort::standard, true}).bytes.size());
  }
}

TEST(PointsCodec, RefusesWhatItCannotCode) {
  const Quantizer quantizer{{0, 0, 0}, 0.01, kF32};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(encode_points({}, quantizer, {}).error().code, ErrorCode::kEmpty);
  for (const double bad : {nan, inf, -inf, 1e300}) {
    const Cloud cloud{{0, 0, 0}, {0, bad, 0}};
    EXPECT_EQ(encode_points(cloud, quantizer, {}).error().code, ErrorCode::kInvalidArgument);
  }
  const Cloud wide{{0, 0, 0}, {0, 0, 30000}};
  EXPECT_EQ(encode_points(wide, quantizer, {}).error().code, ErrorCode::kInvalidArgument);
  for (const double step : {0.0, -1.0, nan, inf}) {
    EXPECT_EQ(encode_points(wide, {{0, 0, 0}, step, kF32}, {}).error().code, ErrorCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace mapcodec
