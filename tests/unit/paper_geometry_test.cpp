// SPDX-License-Identifier: GPL-3.0-or-later
// The steps of the paper's method, one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "mapcodec/codec/paper_region.hpp"
#include "mapcodec/geometry/alpha_shape.hpp"
#include "mapcodec/geometry/kmeans.hpp"
#include "mapcodec/geometry/outlier_filter.hpp"
#include "mapcodec/geometry/plane_ransac.hpp"
#include "tests/unit/paper_support.hpp"

namespace mapcodec {
namespace {

std::vector<std::uint32_t> all_of(std::size_t count) {
  std::vector<std::uint32_t> r(count);
  std::iota(r.begin(), r.end(), 0u);
  return r;
}

double signed_area(const std::vector<Point2>& points, const Contour& contour) {
  double sum = 0;
  for (std::size_t i = 0; i < contour.size(); ++i) {
    const Point2 &a = points[contour[i]], &b = points[contour[(i + 1) % contour.size()]];
    sum += a[0] * b[1] - a[1] * b[0];
  }
  return sum / 2;
}

TEST(PaperRegion, OpenEdgesEqualASet) {
  paper::OpenEdges edges;
  SplitMix random(1);
  for (std::uint32_t round = 0; round < 3; ++round) {
    const std::uint32_t first = 7 * round;
    edges.clear(first);
    std::set<std::pair<std::uint32_t, std::uint32_t>> expected;
    for (int i = 0; i < 20000; ++i) {
      // Few first vertices, so that more edges leave each than fit in place.
      const auto a = first + static_cast<std::uint32_t>(random.next() % 3);
      const auto b = first + static_cast<std::uint32_t>(random.next() % 20);
      ASSERT_EQ(edges.contains(a, b), expected.contains({a, b}));
      if (random.next() % 2 == 0) {
        ASSERT_EQ(edges.erase(a, b), expected.erase({a, b}) != 0);
      } else if (expected.insert({a, b}).second) {
        edges.insert(a, b);
      }
      const auto after = expected.upper_bound({a, paper::kNoVertex});
      const bool none = after == expected.begin() || std::prev(after)->first != a;
      ASSERT_EQ(edges.last(a), none ? paper::kNoVertex : std::prev(after)->second);
    }
  }
  EXPECT_EQ(edges.last(1000), paper::kNoVertex);
}

TEST(PaperSampler, ApportionsExactly) {
  SplitMix random(1);
  for (const std::size_t count : {1u, 2u, 7u, 1000u}) {
    std::vector<std::uint64_t> weights(count);
    for (auto& w : weights) w = random.next() >> (random.next() % 64);
    for (const std::uint64_t total : {0ull, 1ull, 999ull, 4294967295ull}) {
      const auto shares = apportion(weights, total);
      EXPECT_EQ(std::accumulate(shares.begin(), shares.end(), std::uint64_t{0}), total);
    }
  }
  EXPECT_TRUE(apportion({}, 5).empty());
  EXPECT_EQ(apportion(std::vector<std::uint64_t>{0, 0}, 4), (std::vector<std::uint32_t>{2, 2}));
  EXPECT_EQ(apportion(std::vector<std::uint64_t>{1, 3}, 8), (std::vector<std::uint32_t>{2, 6}));
}

TEST(PaperSampler, FillsTheTriangleEvenly) {
  const Vec3 a{0, 0, 0}, b{2, 0, 0}, c{0, 1, 0};
  std::vector<Vec3> points(20000);
  SplitMix random(3);
  sample_triangle(a, b, c, random, false, points);
  Vec3 mean{};
  for (const Vec3& p : points) {
    EXPECT_GE(p[0], 0);
    EXPECT_GE(p[1], 0);
    EXPECT_LE(p[0] / 2 + p[1], 1 + 1e-9);
    for (std::size_t d = 0; d < 3; ++d) mean[d] += p[d] / 20000;
  }
  EXPECT_NEAR(mean[0], 2.0 / 3, 0.02);
  EXPECT_NEAR(mean[1], 1.0 / 3, 0.01);
  EXPECT_DOUBLE_EQ(triangle_area(a, b, c), 1);
}

TEST(PaperRansac, FindsTheLargestPlane) {
  const PointCloud room = test::make_room(5000);
  const auto plane = find_largest_plane(room.xyz, all_of(room.size()), 0.02);
  ASSERT_TRUE(plane);
  EXPECT_NEAR(plane->normal[2], 1, 1e-3);
  EXPECT_NEAR(plane->offset_m, 0.005, 2e-3);
  const auto again = find_largest_plane(room.xyz, all_of(room.size()), 0.02);
  EXPECT_EQ(plane->normal, again->normal);
}

TEST(PaperRansac, DegenerateInputIsNoPlaneAndNoCrash) {
  const std::vector<Vec3> equal(100, Vec3{1, 2, 3});
  EXPECT_FALSE(find_largest_plane(equal, all_of(100), 0.01));
  EXPECT_FALSE(find_largest_plane(equal, all_of(2), 0.01));
  std::vector<Vec3> line;
  for (int i = 0; i < 100; ++i) line.push_back({0.25 * i, 0.5 * i, 0});
  EXPECT_FALSE(find_largest_plane(line, all_of(100), 0.01));
}

TEST(PaperOutliers, EqualsThePlainSearch) {
  SplitMix random(5);
  std::vector<Vec3> points(800);
  for (Vec3& p : points) p = {test::unit(random) - 0.5, test::unit(random), 2 * test::unit(random)};
  for (const double radius : {0.02, 0.1, 0.15, 3.0}) {
    const auto fast = find_supported_points(points, all_of(points.size()), 5, radius);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto near = std::count_if(points.begin(), points.end(), [&](const Vec3& q) {
        return std::hypot(q[0] - points[i][0], q[1] - points[i][1], q[2] - points[i][2]) <= radius;
      });
      EXPECT_EQ(fast[i], near - 1 >= 5) << i << " " << radius;
    }
  }
}

TEST(PaperKmeans, SeparatesColors) {
  std::vector<std::array<std::uint16_t, 3>> colors;
  for (std::uint16_t i = 0; i < 300; ++i) {
    const auto jitter = static_cast<std::uint16_t>(i % 7);
    colors.push_back(
        {static_cast<std::uint16_t>(100 * (i % 3) + jitter), 10, static_cast<std::uint16_t>(200 - jitter)});
  }
  const auto cluster = cluster_colors(colors, 3);
  for (std::size_t i = 3; i < colors.size(); ++i) EXPECT_EQ(cluster[i], cluster[i % 3]);
  EXPECT_NE(cluster[0], cluster[1]);
  EXPECT_NE(cluster[1], cluster[2]);
}

TEST(PaperKmeans, FewerColorsThanClusters) {
  const std::vector<std::array<std::uint16_t, 3>> equal(50, {1, 2, 3});
  for (const std::uint32_t c : cluster_colors(equal, 20)) EXPECT_EQ(c, 0u);
  EXPECT_TRUE(cluster_colors({}, 4).empty());
}

TEST(PaperContour, SquareKeepsItsCorners) {
  std::vector<Point2> points;
  for (int i = 0; i < 10; ++i) points.push_back({0.1 * i, 0});
  for (int i = 0; i < 10; ++i) points.push_back({1, 0.1 * i});
  for (int i = 0; i < 10; ++i) points.push_back({1 - 0.1 * i, 1});
  for (int i = 0; i < 10; ++i) points.push_back({0, 1 - 0.1 * i});
  auto kept = reduce_contour(points, all_of(points.size()), 0.01);
  std::sort(kept.begin(), kept.end());
  EXPECT_EQ(kept, (Contour{0, 10, 20, 30}));
}

TEST(PaperContour, LeavesNothingFartherThanTheTolerance) {
  std::vector<Point2> points;
  SplitMix random(9);
  for (int i = 0; i < 400; ++i) {
    const double angle = 2 * 3.14159265358979 * i / 400, r = 1 + 0.05 * test::unit(random);
    points.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  const auto kept = reduce_contour(points, all_of(points.size()), 0.03);
  EXPECT_LT(kept.size(), 200u);
  for (const Point2& p : points) {
    double least = 9;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const Point2 &a = points[kept[i]], &b = points[kept[(i + 1) % kept.size()]];
      const double x = b[0] - a[0], y = b[1] - a[1];
      const double t = std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / (x * x + y * y), 0.0, 1.0);
      least = std::min(least, std::hypot(p[0] - a[0] - t * x, p[1] - a[1] - t * y));
    }
    EXPECT_LE(least, 0.03 + 1e-12);
  }
}

TEST(PaperContour, DegenerateContours) {
  const std::vector<Point2> equal(5, Point2{1, 1});
  EXPECT_LT(reduce_contour(equal, all_of(5), 0.01).size(), 3u);
  const std::vector<Point2> line{{0, 0}, {1, 0}, {2, 0}, {1, 0}};
  EXPECT_LT(reduce_contour(line, all_of(4), 0.01).size(), 3u);
  EXPECT_TRUE(reduce_contour(equal, {}, 0.01).empty());
}

std::vector<Point2> ring(std::size_t count) {
  std::vector<Point2> points;
  SplitMix random(2);
  while (points.size() < count) {
    const Point2 p{2 * test::unit(random) - 1, 2 * test::unit(random) - 1};
    const double r = std::hypot(p[0], p[1]);
    if (r < 1 && r > 0.5) points.push_back(p);
  }
  return points;
}

TEST(PaperAlphaShape, RingHasAnOutlineAndAHole) {
  const auto points = ring(20000);
  const auto contours = find_concave_hull(points, 0.1);
  ASSERT_TRUE(contours.ok());
  ASSERT_EQ(contours->size(), 2u);
  std::vector<double> areas{signed_area(points, (*contours)[0]), signed_area(points, (*contours)[1])};
  std::sort(areas.begin(), areas.end());
  EXPECT_NEAR(areas[0], -0.25 * 3.1416, 0.05);
  EXPECT_NEAR(areas[1], 3.1416, 0.05);
}

TEST(PaperAlphaShape, ThinningKeepsTheContours) {
  const auto points = ring(20000);
  const auto kept = thin_inner_points(points, 0.025);
  EXPECT_LT(kept.size(), 10000u);
  const auto thinned = find_concave_hull(points, 0.1);
  const auto plain = find_alpha_contours(points, 0.1);
  ASSERT_TRUE(thinned.ok() && plain.ok());
  double a = 0, b = 0;
  for (const Contour& c : *thinned) a += signed_area(points, c);
  for (const Contour& c : *plain) b += signed_area(points, c);
  EXPECT_NEAR(a, b, 1e-9);
}

TEST(PaperAlphaShape, AlphaBelowTheSpacingStillGivesASurface) {
  const auto points = ring(500);
  const auto contours = find_alpha_contours(points, 1e-4);
  ASSERT_TRUE(contours.ok());
  double area = 0;
  for (const Contour& c : *contours) area += signed_area(points, c);
  EXPECT_GT(area, 0.7 * 0.75 * 3.1416);
}

TEST(PaperAlphaShape, DegenerateInput) {
  const std::vector<Point2> equal(9, Point2{1, 1});
  EXPECT_TRUE(find_concave_hull(equal, 0.1)->empty());
  EXPECT_TRUE(find_concave_hull({}, 0.1)->empty());
  std::vector<Point2> line;
  for (int i = 0; i < 9; ++i) line.push_back({0.5 * i, 0.25 * i});
  EXPECT_TRUE(find_concave_hull(line, 0.1)->empty());
}

TEST(PaperTriangulation, CrossingSidesAreNotAnError) {
  const std::vector<Point2> bow{{0, 0}, {1, 1}, {1, 0}, {0, 1}};
  const std::vector<Contour> contours{{0, 1, 2, 3}};
  const auto mesh = triangulate_contours(bow, contours, std::vector<Point2>{{0.9, 0.5}, {5, 5}});
  ASSERT_TRUE(mesh.ok());
  EXPECT_EQ(mesh->triangles.size(), 2u);
  EXPECT_NE(mesh->triangle_of[0], PlanarTriangles::kOutside);
  EXPECT_EQ(mesh->triangle_of[1], PlanarTriangles::kOutside);
}

}  // namespace
}  // namespace mapcodec
