// SPDX-License-Identifier: GPL-3.0-or-later
// Patches to planes, outlines, meshes, cylinders and text.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "slam_adapter/cylinders.hpp"
#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/mesh_orient.hpp"
#include "slam_adapter/mesh_weld.hpp"
#include "slam_adapter/plane_merge.hpp"
#include "slam_adapter/planes_json.hpp"

namespace mapcodec::test {
namespace {

SurfacePatch quad(const Vec3& corner, const Vec3& u, const Vec3& v, std::uint64_t points = 100) {
  SurfacePatch p;
  const auto at = [&](double s, double t) {
    Vec3 r;
    for (std::size_t d = 0; d < 3; ++d) r[d] = corner[d] + s * u[d] + t * v[d];
    return r;
  };
  p.polygon = {at(0, 0), at(1, 0), at(1, 1), at(0, 1)};
  p.center = at(0.5, 0.5);
  p.normal = cross(u, v);
  p.area_m2 = std::sqrt(dot(p.normal, p.normal));
  for (double& x : p.normal) x /= p.area_m2;
  p.points = points;
  return p;
}

/// A floor of n x n cells of 0.5 m, each of them off by up to `off`; holes where `skip` says so.
template <class F>
std::vector<SurfacePatch> floor_of(int n, const Vec3& origin, double off, F&& skip) {
  std::vector<SurfacePatch> patches;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      if (skip(x, y)) continue;
      const double z = off * (((x * 7 + y * 3) % 5) / 4.0 - 0.5);
      patches.push_back(
          quad({origin[0] + 0.5 * x, origin[1] + 0.5 * y, origin[2] + z}, {0.5, 0, 0}, {0, 0.5, 0}));
    }
  }
  return patches;
}

const auto kNone = [](int, int) { return false; };

TEST(PlaneMerge, CellsOfAFloorAreOnePlane) {
  for (const Vec3& origin : {Vec3{0, 0, 0}, Vec3{1e6, -2e6, 500}}) {
    const auto patches = floor_of(8, origin, 0.004, kNone);
    const auto planes = merge_patches(patches, {0.01, 0.26, 100});
    ASSERT_EQ(planes.size(), 1u);
    const MapPlane& p = planes[0];
    EXPECT_EQ(p.points, 6400u);
    EXPECT_NEAR(p.area_m2, 16, 1e-6);
    EXPECT_GT(p.normal[2], 0.9999);
    EXPECT_NEAR(p.offset_m, dot(p.normal, p.center), 1e-9);
    EXPECT_LT(p.rms_m, 0.002);
    ASSERT_EQ(p.outlines.size(), 1u);
    EXPECT_NEAR(p.outlines[0].area_m2, 16, 0.3);
    EXPECT_LE(p.outlines[0].ring.size(), 8u);
    EXPECT_TRUE(p.outlines[0].holes.empty());
  }
}

TEST(PlaneMerge, HolesAndPiecesAreKept) {
  // A hole of one cell; what touches at nothing is a plane of its own.
  auto patches = floor_of(5, {0, 0, 0}, 0, [](int x, int y) { return x == 2 && y == 2; });
  const auto apart = floor_of(2, {10, 0, 0}, 0, kNone);
  patches.insert(patches.end(), apart.begin(), apart.end());
  const auto planes = merge_patches(patches, {0.01, 0.26, 100});
  ASSERT_EQ(planes.size(), 2u);
  EXPECT_EQ(planes[0].points, 2400u);
  ASSERT_EQ(planes[0].outlines.size(), 1u);
  ASSERT_EQ(planes[0].outlines[0].holes.size(), 1u);
  EXPECT_NEAR(planes[0].outlines[0].area_m2, 6, 0.2);
}

TEST(PlaneMerge, CornersAndStepsDivide) {
  std::vector<SurfacePatch> patches = floor_of(4, {0, 0, 0}, 0, kNone);
  for (int i = 0; i < 4; ++i) patches.push_back(quad({0.5 * i, 0, 0}, {0.5, 0, 0}, {0, 0, 1}));
  for (const SurfacePatch& p : floor_of(4, {2, 0, 0.1}, 0, kNone)) patches.push_back(p);
  const auto planes = merge_patches(patches, {0.01, 0.26, 100});
  EXPECT_EQ(planes.size(), 3u);
}

TEST(PlaneMerge, SmallPlanesAreLeftOut) {
  const auto patches = floor_of(1, {0, 0, 0}, 0, kNone);
  EXPECT_EQ(merge_patches(patches, {0.01, 0.26, 100}).size(), 1u);
  EXPECT_TRUE(merge_patches(patches, {0.01, 0.26, 101}).empty());
  EXPECT_TRUE(merge_patches({}, {0.01, 0.26, 1}).empty());
}

TEST(MeshWeld, CellsShareTheirVertices) {
  const SurfaceMesh mesh = weld_patches(floor_of(4, {0, 0, 0}, 0.008, kNone), 0.01);
  EXPECT_EQ(mesh.vertices.size(), 25u);
  EXPECT_EQ(mesh.faces.size(), 32u);
  EXPECT_TRUE(mesh.rgb.empty());
}

/// Edges with one face only.
std::size_t open_edges(const SurfaceMesh& mesh) {
  std::map<std::array<std::uint32_t, 2>, int> edges;
  for (const auto& f : mesh.faces) {
    for (std::size_t i = 0; i < 3; ++i)
      ++edges[{std::min(f[i], f[(i + 1) % 3]), std::max(f[i], f[(i + 1) % 3])}];
  }
  return std::size_t(std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second == 1; }));
}

TEST(MeshWeld, LargeAndSmallCellsClose) {
  std::vector<SurfacePatch> patches{quad({-1, 0, 0.004}, {1, 0, 0}, {0, 1, 0})};
  for (int y = 0; y < 4; ++y) patches.push_back(quad({0, 0.25 * y, 0}, {0.25, 0, 0}, {0, 0.25, 0}));
  const SurfaceMesh mesh = weld_patches(patches, 0.01);
  // Around both together: 3 long edges, 4 short ones, and two short sides of the strip.
  EXPECT_EQ(open_edges(mesh), 3u + 4u + 2u);
}

TEST(MeshOrient, NeighborsShowOneSide) {
  // A floor and a wall that meet in an edge, a third of the patches seen from behind.
  std::vector<SurfacePatch> patches = floor_of(4, {0, 0, 0}, 0, kNone);
  for (int i = 0; i < 4; ++i) patches.push_back(quad({0.5 * i, 0, 0}, {0, 0, 0.5}, {0.5, 0, 0}));
  for (std::size_t i = 0; i < patches.size(); i += 3) {
    std::reverse(patches[i].polygon.begin(), patches[i].polygon.end());
    for (double& x : patches[i].normal) x = -x;
  }
  SurfaceMesh mesh = weld_patches(patches, 0.01);
  const std::size_t faces = mesh.faces.size();
  orient_faces(mesh);
  ASSERT_EQ(mesh.faces.size(), faces);
  std::map<std::array<std::uint32_t, 2>, int> edges;
  for (const auto& f : mesh.faces) {
    for (std::size_t i = 0; i < 3; ++i) ++edges[{f[i], f[(i + 1) % 3]}];
    const Vec3 up = cross(minus(mesh.vertices[f[1]], mesh.vertices[f[0]]),
                          minus(mesh.vertices[f[2]], mesh.vertices[f[0]]));
    EXPECT_GE(up[2], 0);  // two thirds of the floor looked up
    EXPECT_GE(up[1], 0);
  }
  for (const auto& [edge, times] : edges) EXPECT_EQ(times, 1);
  SurfaceMesh none;
  orient_faces(none);
  EXPECT_TRUE(none.faces.empty());
}

TEST(MeshWeld, TintsFollowThePatches) {
  std::vector<SurfacePatch> patches = floor_of(1, {0, 0, 0}, 0, kNone);
  patches[0].colored = true;
  patches[0].rgb = {250, 100.4, 3};
  const SurfaceMesh mesh = weld_patches(patches, 0.01);
  ASSERT_EQ(mesh.rgb.size(), mesh.vertices.size());
  EXPECT_EQ(mesh.rgb[0], (std::array<std::uint8_t, 3>{250, 100, 3}));
}

TEST(Cylinders, APipeIsOneAndABoxIsNone) {
  std::vector<SurfacePatch> pipe;
  const double r = 0.2;
  const auto on = [&](int i) { return i * std::numbers::pi / 12; };
  for (int i = 0; i < 24; ++i) {
    for (int k = 0; k < 10; ++k) {
      const Vec3 a{r * std::cos(on(i)), r * std::sin(on(i)), 0.1 * k};
      const Vec3 b{r * std::cos(on(i + 1)), r * std::sin(on(i + 1)), 0.1 * k};
      pipe.push_back(quad(a, minus(b, a), {0, 0, 0.1}, 40));
    }
  }
  const auto planes = merge_patches(pipe, {0.005, 0.26, 100});
  EXPECT_GT(planes.size(), 3u);
  CylinderSettings settings;
  settings.tolerance_m = 0.005;
  const auto cylinders = find_cylinders(pipe, planes, settings);
  // Only a build without CGAL has no cylinders.
  if (!cylinders.ok() && cylinders.error().code == ErrorCode::kUnsupported)
    GTEST_SKIP() << cylinders.error().message;
  ASSERT_TRUE(cylinders.ok()) << cylinders.error().message;
  ASSERT_EQ(cylinders->size(), 1u);
  const MapCylinder& c = (*cylinders)[0];
  EXPECT_NEAR(c.radius_m, r, 0.005);
  EXPECT_GT(std::abs(c.axis[2]), 0.99);
  EXPECT_NEAR(c.length_m, 1, 0.1);
  EXPECT_GT(c.points, 8000u);
  EXPECT_GT(c.arc_rad, 5.5);
  const auto again = find_cylinders(pipe, planes, settings);
  EXPECT_EQ((*again)[0].radius_m, c.radius_m);
  EXPECT_EQ((*again)[0].patches, c.patches);

  const auto floor = floor_of(8, {0, 0, 0}, 0.002, kNone);
  const auto none = find_cylinders(floor, merge_patches(floor, {0.005, 0.26, 100}), settings);
  ASSERT_TRUE(none.ok());
  EXPECT_TRUE(none->empty());
}

TEST(PlanesJson, SaysWhatThereIs) {
  MapPrimitives m;
  m.map_points = 7000;
  m.tolerance_m = 0.01;
  m.planes = merge_patches(floor_of(8, {0, 0, 0}, 0, kNone), {0.01, 0.26, 100});
  const std::string text = primitives_json(m);
  for (const char* part :
       {"\"map_points\": 7000", "\"plane_points\": 6400", "\"normal\": [0, 0, 1]", "\"holes\": []"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  EXPECT_EQ(text.find("cylinders\""), std::string::npos);
  m.with_cylinders = true;
  EXPECT_NE(primitives_json(m).find("\"cylinders\": []"), std::string::npos);
}

TEST(LevelErrors, ComeBackRoundedUp) {
  LevelErrors e{3, 123456, {{0.5, 0.01}, {0.02, 0.5}, {0.0099, 1}}};
  const Bytes bytes = write_level_errors(e);
  EXPECT_LE(bytes.size(), 10u);
  const auto back = read_level_errors(bytes);
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->tiles, 3u);
  EXPECT_EQ(back->points, 123456u);
  ASSERT_EQ(back->levels.size(), 3u);
  for (std::size_t l = 0; l < 3; ++l) {
    EXPECT_GE(back->levels[l].rms_m, 0.9999 * e.levels[l].rms_m);
    EXPECT_LE(back->levels[l].rms_m, 1.06 * e.levels[l].rms_m);
    EXPECT_NEAR(back->levels[l].byte_share, e.levels[l].byte_share, 1.0 / 255);
  }
  EXPECT_FALSE(read_level_errors(ByteSpan(bytes).subspan(0, 2)).ok());
  EXPECT_FALSE(read_level_errors(ByteSpan(bytes).subspan(0, bytes.size() - 1)).ok());
  EXPECT_FALSE(read_level_errors({}).ok());
}

}  // namespace
}  // namespace mapcodec::test
