// SPDX-License-Identifier: GPL-3.0-or-later
// Pieces of surface that touch: no slits between them, and a density that goes on.
#include <gtest/gtest.h>

#include <random>

#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/grid_nearest.hpp"
#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

/// A wavy floor that falls towards +x, as a camera sees it: denser where it is near.
Cloud floor(double from, double to, std::size_t count, unsigned seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> any(0, 1);
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = any(rng), x = from + (to - from) * t * t, y = 2 * any(rng);
    cloud.push_back({x, y, 1 - 0.4 * x + 0.02 * std::sin(5 * x) * std::cos(4 * y)});
  }
  return cloud;
}

double largest(const std::vector<double>& squared) {
  return std::sqrt(*std::max_element(squared.begin(), squared.end()));
}

TEST(SurfaceSeams, NoPointOfASurfaceIsFarFromTheDecodedOne) {
  const Cloud cloud = floor(0, 3, 60000, 1);
  for (const double step : {0.02, 0.04}) {
    const auto e = encode_surface(cloud, steps_of(step), {});
    ASSERT_TRUE(e.ok());
    const NearestPair near = find_nearest_pair(cloud, e->decoded);
    EXPECT_LT(largest(near.forth.squared), 2 * step) << step;
  }
}

TEST(SurfaceSeams, DensityFollowsTheLeavesBeside) {
  const Cloud cloud = floor(0, 3, 60000, 2);
  // The surface takes fewer than a hundred bytes: coarser steps have too few leaves to follow.
  for (const double step : {0.03, 0.036}) {
    const auto e = encode_surface(cloud, steps_of(step), {});
    ASSERT_TRUE(e.ok());
    EXPECT_LT(density_error(cloud, e->decoded), 0.22) << step;
  }
}

TEST(SurfaceSeams, TilesOverlapWhereTheSurfaceGoesOn) {
  const Cloud all = floor(0, 2, 40000, 3);
  Cloud left, right;
  for (const Vec3& p : all) (p[0] < 1 ? left : right).push_back(p);
  const double step = 0.03;
  const auto decoded = [&](const Cloud& cloud, double from, std::uint8_t occupied) {
    SurfaceSettings s;
    s.borders = {{{from, 0, -1}, {from + 1, 3, 2}}, occupied};
    auto e = encode_surface(cloud, steps_of(step), s);
    EXPECT_TRUE(e.ok());
    const auto d = decode_surface(e->bytes, cloud.size(), steps_of(step), {});
    EXPECT_TRUE(d.ok() && d->xyz == e->decoded);
    Box b;
    for (const Vec3& p : e->decoded) b.add(p);
    return b;
  };
  EXPECT_LT(decoded(left, 0, 0).max[0], 1 + step);
  EXPECT_GT(decoded(right, 1, 0).min[0], 1 - 1e-3);
  // With a neighbour both go beyond the border by a part of a step.
  EXPECT_GT(decoded(left, 0, 2).max[0], 1);
  EXPECT_LT(decoded(left, 0, 2).max[0], 1 + 1.5 * step);
  EXPECT_LT(decoded(right, 1, 1).min[0], 1 - 0.05 * step);
  EXPECT_GT(decoded(right, 1, 1).min[0], 1 - step);
}

TEST(SurfaceSeams, HeadersOfBothKindsAreRead) {
  surface::Header h;
  h.depth = 9;
  for (const bool fitted : {false, true}) {
    h.fitted = fitted;
    h.extent = {1, 300, fitted ? surface::kMostExtent : 1};
    h.borders = 33;
    ByteWriter out;
    surface::write_header(out, h);
    const Bytes bytes = out.take();
    ByteReader in(bytes);
    const auto r = surface::read_header(in);
    ASSERT_TRUE(r.ok());
    EXPECT_EQ(r->depth, 9);
    EXPECT_EQ(r->fitted, fitted);
    EXPECT_TRUE(!fitted || r->extent == h.extent);
    EXPECT_EQ(r->borders, fitted ? 33 : 0);
  }
}

TEST(SurfaceSeams, AnExtentOfNothingIsDamage) {
  surface::Header h;
  h.fitted = true;
  h.extent = {1, 0, 1};
  ByteWriter out;
  surface::write_header(out, h);
  const Bytes bytes = out.take();
  ByteReader in(bytes);
  EXPECT_EQ(surface::read_header(in).error().code, ErrorCode::kMalformed);
}

}  // namespace
}  // namespace mapcodec::test
