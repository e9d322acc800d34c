// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/evaluation.hpp"

#include <gtest/gtest.h>

#include "mapcodec/quality/tile_errors.hpp"
#include "tests/unit/quality_support.hpp"

namespace mapcodec {
namespace {

using test::points;
using test::random_cloud;
using test::zero_channel;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

Evaluation measure(const PointCloud& a, const PointCloud& b, const EvaluationSettings& s = {}) {
  SerialRunner serial;
  Result<Evaluation> r = evaluate(a, b, serial, s);
  EXPECT_TRUE(r.ok());
  return r.ok() ? *r : Evaluation{};
}

PointCloud with_colors(PointCloud cloud, std::array<std::uint8_t, 3> rgb) {
  Channel c = zero_channel("rgb", ScalarType::u8, 3, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) c.data.insert(c.data.end(), rgb.begin(), rgb.end());
  cloud.channels.push_back(c);
  return cloud;
}

/// Runs odd pieces backwards: the result must not care.
class OddRunner final : public Runner {
 public:
  void run(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) override {
    for (std::size_t end = count; end > 0;) {
      const std::size_t begin = end > 37 ? end - 37 : 0;
      body(begin, end);
      end = begin;
    }
  }
};

TEST(Evaluation, EmptyIsAnError) {
  SerialRunner serial;
  const PointCloud none, one = points({{1, 2, 3}});
  EXPECT_EQ(evaluate(none, one, serial).error().code, ErrorCode::kEmpty);
  EXPECT_EQ(evaluate(one, none, serial).error().code, ErrorCode::kEmpty);
  EXPECT_EQ(evaluate(points({{kNan, 0, 0}}), one, serial).error().code, ErrorCode::kEmpty);
}

TEST(Evaluation, SettingsOutOfRangeAreErrors) {
  SerialRunner serial;
  const PointCloud one = points({{1, 2, 3}});
  EXPECT_FALSE(evaluate(one, one, serial, {.voxel_m = 0}).ok());
  EXPECT_FALSE(evaluate(one, one, serial, {.shifts = 0}).ok());
  EXPECT_FALSE(evaluate(one, one, serial, {.knn = 0}).ok());
  EXPECT_FALSE(evaluate(one, one, serial, {.peak_m = kNan}).ok());
}

TEST(Evaluation, IdenticalCloudsHaveNoError) {
  const PointCloud a = random_cloud(2000, 2, {0, 0, 0}, 1);
  const Evaluation e = measure(a, a);
  EXPECT_EQ(e.points_original, 2000u);
  EXPECT_EQ(e.count_ratio, 1);
  EXPECT_EQ(e.rms_m, 0);
  EXPECT_EQ(e.max_axis_error_m, 0);
  EXPECT_EQ(e.color_error, 0);
  EXPECT_EQ(e.density_error, 0);
  EXPECT_EQ(e.d1_psnr_db, kInf);
  EXPECT_EQ(e.d2_psnr_db, kInf);
}

TEST(Evaluation, ShiftedSquare) {
  const PointCloud a = with_colors(points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}), {10, 20, 30});
  const PointCloud b =
      with_colors(points({{0, 0, 0.1}, {1, 0, 0.1}, {0, 1, 0.1}, {1, 1, 0.1}}), {13, 24, 30});
  const Evaluation e = measure(a, b, {.knn = 4});
  EXPECT_NEAR(e.rms_m, 0.1, 1e-12);
  EXPECT_NEAR(e.rms_pool_m, 0.1, 1e-12);
  EXPECT_NEAR(e.max_m, 0.1, 1e-12);
  EXPECT_NEAR(e.color_error, 5, 1e-12);
  // Along the normal, both measures see all of the distance: 3 / 0.01 is 24.77 dB.
  EXPECT_NEAR(e.d1_psnr_db, 10 * std::log10(300.0), 1e-9);
  EXPECT_NEAR(e.d2_psnr_db, e.d1_psnr_db, 1e-9);
}

TEST(Evaluation, DirectionsDiffer) {
  const PointCloud a = points({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}), b = points({{0, 0, 0}});
  const Evaluation e = measure(a, b);
  EXPECT_EQ(e.rms_ba_m, 0);
  EXPECT_NEAR(e.rms_ab_m, 1, 1e-12);
  EXPECT_NEAR(e.rms_pool_m, std::sqrt(4.0 / 5), 1e-12);
  EXPECT_NEAR(e.max_m, std::sqrt(2.0), 1e-12);
  EXPECT_EQ(e.max_axis_error_m, 1);
  EXPECT_EQ(e.count_ratio, 0.25);
  EXPECT_NEAR(e.density_error, 0.75, 1e-12);
  EXPECT_TRUE(std::isnan(e.color_error));
  EXPECT_TRUE(std::isnan(e.y_psnr_db));
}

TEST(Evaluation, NormalsOfTheFileAreUsed) {
  for (const ScalarType scalar : {ScalarType::f32, ScalarType::f64}) {
    PointCloud a = points({{0, 0, 0}, {1, 0, 0}});
    Channel normal = zero_channel("normal", scalar, 3, 2);
    for (std::size_t i = 0; i < 2; ++i) {  // along y, not of unit length
      if (scalar == ScalarType::f32) normal.set<float>(i, 2.0F, 1);
      if (scalar == ScalarType::f64) normal.set<double>(i, 2.0, 1);
    }
    a.channels.push_back(normal);
    const Evaluation e = measure(a, points({{0, 0.1, 0.3}, {1, 0.1, 0.3}}));
    EXPECT_NEAR(e.d2_psnr_db, 10 * std::log10(3 / 0.01), 1e-9);
  }
}

TEST(Evaluation, SixteenBitColorsAreScaled) {
  PointCloud a = points({{0, 0, 0}}), b = with_colors(points({{0, 0, 0}}), {100, 0, 255});
  Channel c = zero_channel("rgb", ScalarType::u16, 3, 1);
  c.set<std::uint16_t>(0, 110 * 257, 0);
  c.set<std::uint16_t>(0, 65535, 2);
  a.channels.push_back(c);
  EXPECT_NEAR(measure(a, b).color_error, 10, 1e-12);
}

TEST(Evaluation, NonFinitePointsAreLeftOut) {
  const PointCloud a = points({{0, 0, 0}, {kNan, 0, 0}, {1, 0, kInf}, {1, 1, 1}});
  const Evaluation e = measure(a, points({{0, 0, 0}, {1, 1, 1}}));
  EXPECT_EQ(e.points_original, 2u);
  EXPECT_EQ(e.rms_m, 0);
  EXPECT_EQ(e.density_error, 0);
}

TEST(Evaluation, FarFromTheOrigin) {
  const PointCloud a = random_cloud(3000, 4, {1e6, 5e6, 100}, 2);
  PointCloud b = a;
  for (Vec3& p : b.xyz) p[1] += 0.001;
  const Evaluation e = measure(a, b);
  EXPECT_NEAR(e.rms_m, 0.001, 1e-6);
  EXPECT_NEAR(e.max_axis_error_m, 0.001, 1e-6);
}

TEST(Evaluation, DegenerateShapes) {
  const PointCloud equal = points(std::vector<Vec3>(100, Vec3{1, 2, 3}));
  EXPECT_EQ(measure(equal, equal).rms_m, 0);
  std::vector<Vec3> line;
  for (int i = 0; i < 100; ++i) line.push_back({0.1 * i, 0, 0});
  EXPECT_EQ(measure(points(line), points(line)).d2_psnr_db, kInf);
}

TEST(Evaluation, TheSplitDoesNotMatter) {
  const PointCloud a = random_cloud(3000, 2, {0, 0, 0}, 3, 0.1), b = random_cloud(2000, 2, {0, 0, 0}, 4, 0.1);
  SerialRunner serial;
  OddRunner odd;
  const Evaluation x = *evaluate(a, b, serial), y = *evaluate(a, b, odd);
  EXPECT_EQ(x.rms_m, y.rms_m);
  EXPECT_EQ(x.d2_psnr_db, y.d2_psnr_db);
  EXPECT_EQ(x.color_error, y.color_error);
  EXPECT_EQ(x.density_error, y.density_error);
}

TEST(Evaluation, EqualsThePlainSearch) {
  const PointCloud a = random_cloud(400, 2, {0, 0, 0}, 5), b = random_cloud(300, 2, {0.1, 0, 0}, 6);
  double sum = 0, most = 0;
  for (const Vec3& p : a.xyz) {
    double best = kInf;
    for (const Vec3& q : b.xyz) best = std::min(best, std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]));
    sum += best * best;
    most = std::max(most, best);
  }
  const Evaluation e = measure(a, b);
  EXPECT_NEAR(e.rms_ab_m, std::sqrt(sum / 400), 1e-12);
  EXPECT_GE(e.max_m, most - 1e-12);
}

TEST(TileErrors, AgreesWithTheEvaluation) {
  const PointCloud a = random_cloud(1000, 1, {3, 0, 0}, 7), b = random_cloud(900, 1, {3, 0, 0}, 8);
  const TileErrors t = measure_tile(a, b);
  const Evaluation e = measure(a, b);
  EXPECT_EQ(t.rms_m, e.rms_m);
  EXPECT_EQ(t.max_axis_error_m, e.max_axis_error_m);
  EXPECT_EQ(t.color_error, e.color_error);
  EXPECT_NEAR(t.density_error, e.density_error, 1e-12);
}

TEST(TileErrors, EmptySides) {
  EXPECT_EQ(measure_tile({}, {}).rms_m, 0);
  EXPECT_EQ(measure_tile(points({{0, 0, 0}}), {}).rms_m, kInf);
  EXPECT_EQ(measure_tile({}, points({{0, 0, 0}})).density_error, kInf);
}

}  // namespace
}  // namespace mapcodec
