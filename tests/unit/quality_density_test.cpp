// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/density.hpp"

#include <gtest/gtest.h>

#include <map>

#include "tests/unit/quality_support.hpp"

namespace mapcodec {
namespace {

using test::random_cloud;

/// The definition, word by word.
double plain_density_error(const std::vector<Vec3>& a, const std::vector<Vec3>& b, double side, int shifts) {
  double result = 0;
  for (int s = 0; s < shifts; ++s) {
    const double offset = side * s / shifts;
    std::map<Vec3, double> cells;
    const auto cell = [&](const Vec3& p) {
      return Vec3{std::floor((p[0] + offset) / side), std::floor((p[1] + offset) / side),
                  std::floor((p[2] + offset) / side)};
    };
    for (const Vec3& p : a) cells[cell(p)] -= 1;
    for (const Vec3& p : b) cells[cell(p)] += 1;
    double sum = 0;
    for (const auto& [key, n] : cells) sum += std::abs(n);
    result += sum / static_cast<double>(a.size()) / shifts;
  }
  return result;
}

TEST(Density, EmptyAndEqual) {
  const std::vector<Vec3> none, one{{1, 2, 3}};
  EXPECT_TRUE(std::isnan(density_error(none, one)));
  EXPECT_TRUE(std::isnan(density_error(none, none)));
  EXPECT_EQ(density_error(one, none), 1);
  EXPECT_EQ(density_error(one, one), 0);
}

TEST(Density, AllElsewhereIsTwo) {
  const std::vector<Vec3> a(50, Vec3{0, 0, 0}), b(50, Vec3{5, 0, 0});
  EXPECT_EQ(density_error(a, b), 2);
}

TEST(Density, EqualsTheDefinition) {
  for (const double lattice : {0.0, 0.05, 0.1}) {  // on a lattice, points lie on the faces of voxels
    for (const Vec3 centre : {Vec3{0, 0, 0}, Vec3{5e5, 4.9e6, 2300}, Vec3{-1e6, 0, 1e9}}) {
      const PointCloud a = random_cloud(4000, 3, centre, 1, lattice),
                       b = random_cloud(3000, 3, centre, 2, lattice);
      EXPECT_NEAR(density_error(a.xyz, b.xyz), plain_density_error(a.xyz, b.xyz, 0.1, 4), 1e-12);
      EXPECT_NEAR(density_error(a.xyz, b.xyz, 0.25, 3), plain_density_error(a.xyz, b.xyz, 0.25, 3), 1e-12);
    }
  }
}

TEST(Density, OfMovedPointsIsTheSame) {
  for (const double moved : {0.0, 0.02, 0.3, 1e9}) {
    const double lattice = moved == 0.02 ? 0.025 : 0;  // then points lie on the faces of voxels
    const PointCloud a = random_cloud(4000, 3, {5e5, 4.9e6, 2300}, 1, lattice),
                     by = random_cloud(4000, moved, {0, 0, 0}, 2);
    std::vector<Vec3> b;
    std::vector<std::uint32_t> order;
    for (std::uint32_t i = 0; i < 4000; ++i) {
      order.push_back((i * 7919) % 4000);
      const Vec3 &p = a.xyz[order.back()], &d = by.xyz[i];
      b.push_back({p[0] + d[0], p[1] + d[1], p[2] + d[2]});
    }
    EXPECT_EQ(density_error_of_moved(a.xyz, b, order), density_error(a.xyz, b));
  }
  EXPECT_TRUE(std::isnan(density_error_of_moved({}, {}, {})));
}

TEST(Density, CellsFarFromEachOther) {
  const PointCloud a = random_cloud(3000, 1e7, {0, 0, 0}, 1);
  std::vector<Vec3> b(a.xyz.begin() + 1000, a.xyz.end());
  EXPECT_NEAR(density_error(a.xyz, b), 1.0 / 3, 1e-12);
}

TEST(Density, StrangeNumbersDoNoHarm) {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Vec3> a{{1e300, -1e300, 0}, {inf, 0, 0}, {0, nan, 0}, {0, 0, 0}},
      b{{0, 0, 0}, {-inf, nan, 0}};
  EXPECT_EQ(density_error(a, b), 0.5);
}

}  // namespace
}  // namespace mapcodec
