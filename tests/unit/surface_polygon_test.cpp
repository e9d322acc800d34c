// SPDX-License-Identifier: GPL-3.0-or-later
// Pieces of planes and the points spread over them.
#include <gtest/gtest.h>

#include <random>

#include "mapcodec/codec/surface_polygon.hpp"

namespace mapcodec::surface {
namespace {

Plane random_plane(std::mt19937& rng, const CellShape& shape) {
  const auto within = [&](std::int64_t most) {
    return static_cast<std::int32_t>(static_cast<std::int64_t>(rng()) % (2 * most + 1) - most);
  };
  Plane p;
  p.axis = static_cast<std::uint8_t>(rng() % 3);
  const std::int64_t half = half_side(shape[p.axis]);
  p.h = within(half);
  p.a = within(2 * half);
  p.b = within(2 * half);
  return p;
}

CellShape random_shape(std::mt19937& rng) {
  const std::uint8_t side = static_cast<std::uint8_t>(1 + rng() % 20);
  return {side, static_cast<std::uint8_t>(side + rng() % 2), static_cast<std::uint8_t>(side + rng() % 2)};
}

TEST(SurfacePolygon, SpreadGivesExactlyAsManyPointsInsideTheCell) {
  std::mt19937 rng(1);
  for (int round = 0; round < 3000; ++round) {
    const CellShape shape = random_shape(rng);
    const Plane plane = random_plane(rng, shape);
    Polygon polygon = polygon_of(plane, shape, Room::whole(shape));
    if (rng() % 2 == 0 && polygon.size >= 3) {
      polygon.rectangle = false;
      cut(polygon, {static_cast<std::uint8_t>(rng() % 16), static_cast<std::uint8_t>(rng() % 32)});
    }
    const std::uint32_t count = rng() % 100;
    std::vector<Vertex> points;
    spread(polygon, plane, shape, count, {}, points);
    ASSERT_EQ(points.size(), count);
    for (const Vertex& x : points) {
      ASSERT_LE(std::abs(x.u), kHalf);
      ASSERT_LE(std::abs(x.v), kHalf);
      ASSERT_LE(std::abs(height_at(plane, shape, x)), half_side(shape[plane.axis]));
    }
  }
}

TEST(SurfacePolygon, PiecesHaveEqualAreas) {
  // In a level square the points of 2^k pieces are the middles of equal rectangles: none are nearer than a
  // side of them.
  const CellShape shape{10, 10, 10};
  for (const std::uint32_t count : {2u, 4u, 16u, 64u, 256u}) {
    std::vector<Vertex> points;
    spread(polygon_of({}, shape, Room::whole(shape)), {}, shape, count, {}, points);
    double mean_u = 0, mean_v = 0, second = 0;
    for (const Vertex& x : points) {
      mean_u += x.u / double(kHalf) / count;
      mean_v += x.v / double(kHalf) / count;
      second += (double(x.u) * x.u + double(x.v) * x.v) / double(kHalf) / kHalf / count;
    }
    EXPECT_NEAR(mean_u, 0, 1e-3);
    EXPECT_NEAR(mean_v, 0, 1e-3);
    EXPECT_NEAR(second, 2.0 / 3,
                0.6 / std::sqrt(double(count)) / std::sqrt(double(count)) + 0.35 / count + 1e-3);
  }
}

TEST(SurfacePolygon, HalvesOfAWedgeHoldTheirShareOfPoints) {
  // A triangle: as many points per area on both sides of any line.
  const CellShape shape{12, 12, 12};
  Polygon triangle;
  triangle.size = 3;
  triangle.at[0] = {-kHalf, -kHalf};
  triangle.at[1] = {kHalf, -kHalf};
  triangle.at[2] = {-kHalf, kHalf};
  std::vector<Vertex> points;
  spread(triangle, {}, shape, 1000, {}, points);
  int near_corner = 0;
  for (const Vertex& x : points) near_corner += x.u < 0 && x.v < 0;
  EXPECT_NEAR(near_corner, 500, 40);  // half of the triangle's area
}

TEST(SurfacePolygon, LowerShareIsThatOfTheArea) {
  const CellShape shape{8, 8, 8};
  EXPECT_EQ(lower_share({0, 0, 0, 2}, shape, Room::whole(shape), 0), 128);
  EXPECT_EQ(lower_share({0, 0, 0, 2}, shape, Room::whole(shape), 1), 128);
  const auto half = static_cast<std::int32_t>(half_side(8));
  EXPECT_EQ(lower_share({-half / 2, 0, 0, 2}, shape, Room::whole(shape), 2), 256);
  EXPECT_EQ(lower_share({half / 2, 0, 0, 2}, shape, Room::whole(shape), 2), 0);
  EXPECT_EQ(lower_share({2 * half, 0, 0, 2}, shape, Room::whole(shape), 2), -1);  // misses the cell
}

TEST(SurfacePolygon, ATiltMakesOneSideDenser) {
  // Density from 1/2 to 3/2 along u: the lower half holds three eighths of the points.
  const CellShape shape{12, 12, 12};
  Polygon cut_corner = polygon_of({}, shape, Room::whole(shape));
  clip(cut_corner, -2 * kHalf, kHalf, kHalf);
  for (const Polygon& polygon : {polygon_of({}, shape, Room::whole(shape)), cut_corner}) {
    std::vector<Vertex> points;
    spread(polygon, {}, shape, 4000, {128, 0}, points);
    ASSERT_EQ(points.size(), 4000u);
    std::size_t low_u = 0, low_v = 0;
    for (const Vertex& x : points) {
      low_u += x.u < 0;
      low_v += x.v < 0;
    }
    EXPECT_NEAR(double(low_u), 1500, 60);
    EXPECT_NEAR(double(low_v), 2000, 60);
  }
}

TEST(SurfacePolygon, StaysInsideItsRoom) {
  std::mt19937 rng(2);
  for (int round = 0; round < 3000; ++round) {
    const CellShape shape = random_shape(rng);
    const Plane plane = random_plane(rng, shape);
    Room room = Room::whole(shape);
    for (std::int32_t& e : room.end) e = 1 + static_cast<std::int32_t>(rng() % static_cast<unsigned>(e));
    const Polygon polygon = polygon_of(plane, shape, room);
    const unsigned u = (plane.axis + 1u) % 3, v = (plane.axis + 2u) % 3;
    for (int i = 0; i < polygon.size; ++i) {
      const Vertex& x = polygon.at[static_cast<std::size_t>(i)];
      EXPECT_LE(x.u, std::int64_t{room.end[u]} * (2 * kHalf) / (1 << shape[u]) - kHalf);
      EXPECT_LE(x.v, std::int64_t{room.end[v]} * (2 * kHalf) / (1 << shape[v]) - kHalf);
    }
  }
}

}  // namespace
}  // namespace mapcodec::surface
