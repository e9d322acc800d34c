// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/planes_file.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/mesh_orient.hpp"
#include "slam_adapter/mesh_ply.hpp"

namespace mapcodec {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// All patches of a region, and the largest step of their tiles.
struct Gathered {
  std::vector<SurfacePatch> patches;
  double step_m = 0;
};

Result<Gathered> gather(const MapFile& map, const Region& region, const ReadSettings& settings,
                        SurfaceReport& report) {
  if (!map.has_surfaces()) {
    return make_error(
        ErrorCode::kUnsupported,
        "keeps points, not surfaces: planes and meshes need a map made with --rms (coarser than "
        "about its points' spacing) or --paper");
  }
  Gathered g;
  MAPCODEC_TRY(map.read_patches(region, settings, [&](std::size_t, TilePatches&& tile) -> Status {
    ++report.tiles_read;
    report.tiles_without += !tile.surfaces;
    report.points += tile.points;
    g.step_m = std::max(g.step_m, tile.step_m);
    for (SurfacePatch& p : tile.patches) {
      if (p.points == 0) continue;
      report.patch_points += p.points;
      g.patches.push_back(std::move(p));
    }
    return {};
  }));
  report.patches = g.patches.size();
  report.bytes_read = map.archive().bytes_read();
  if (g.patches.empty()) return make_error(ErrorCode::kEmpty, "no surface lies in the asked region");
  return g;
}

double rms_of(const MapFile& map) {
  const double rms = map.archive().info().achieved.rms_m;
  return std::isfinite(rms) ? rms : 0;
}

/// Pieces of a plane lie off it by about what they lie off the points.
double merge_tolerance(const MapFile& map, const Gathered& g, const SurfaceOptions& options) {
  if (options.tolerance_m > 0) return options.tolerance_m;
  const double rms = rms_of(map);
  const double known = rms > 0 && g.step_m > 0 ? std::min(g.step_m, 2 * rms) : std::max(g.step_m, 2 * rms);
  return known > 0 ? known : 0.01;
}

/// Two cells see their common face at heights that are rounded to half a step each.
double slit_width(const MapFile& map, const Gathered& g, const SurfaceOptions& options) {
  if (options.tolerance_m > 0) return options.tolerance_m;
  const double known = std::max(g.step_m, rms_of(map));
  return known > 0 ? known : 0.01;
}

void remove_patches(std::vector<SurfacePatch>& patches, const std::vector<MapCylinder>& cylinders) {
  for (const MapCylinder& c : cylinders) {
    for (const std::uint32_t i : c.patches) patches[i].points = 0;
  }
  std::erase_if(patches, [](const SurfacePatch& p) { return p.points == 0; });
}

template <class T>
std::uint64_t points_of(const std::vector<T>& primitives) {
  std::uint64_t n = 0;
  for (const T& p : primitives) n += p.points;
  return n;
}

bool is_ply(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".ply";
}

}  // namespace

Result<MapPrimitives> find_primitives(const MapFile& map, const Region& region, const ReadSettings& settings,
                                      const SurfaceOptions& options, SurfaceReport& report) {
  MAPCODEC_ASSIGN(Gathered g, gather(map, region, settings, report));
  MapPrimitives m;
  m.map_points = report.points;
  m.patches = report.patches;
  m.tolerance_m = report.tolerance_m = merge_tolerance(map, g, options);
  const PlaneMergeSettings merge{m.tolerance_m, PlaneMergeSettings{}.angle_rad, options.least_points};
  m.planes = merge_patches(g.patches, merge);
  m.with_cylinders = options.cylinders;
  if (options.cylinders) {
    CylinderSettings cylinders;
    cylinders.tolerance_m = m.tolerance_m;
    cylinders.least_points = options.least_points;
    MAPCODEC_ASSIGN(m.cylinders, find_cylinders(g.patches, m.planes, cylinders));
    if (!m.cylinders.empty()) {
      remove_patches(g.patches, m.cylinders);
      m.planes = merge_patches(g.patches, merge);
    }
  }
  report.planes = m.planes.size();
  report.plane_points = points_of(m.planes);
  report.cylinders = m.cylinders.size();
  report.cylinder_points = points_of(m.cylinders);
  return m;
}

Result<SurfaceReport> decompress_planes(const std::string& map_path, const std::string& path,
                                        const Region& region, std::optional<std::uint64_t> revision,
                                        const ReadSettings& settings, const SurfaceOptions& options) {
  const auto begin = Clock::now();
  SurfaceReport report;
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  MAPCODEC_ASSIGN(const MapPrimitives primitives, find_primitives(map, region, settings, options, report));
  OutputFile out;
  MAPCODEC_TRY(out.open(path));
  MAPCODEC_TRY(out.append(primitives_json(primitives)));
  MAPCODEC_TRY(out.commit());
  report.seconds = seconds_since(begin);
  return report;
}

Result<SurfaceReport> decompress_mesh(const std::string& map_path, const std::string& path,
                                      const Region& region, std::optional<std::uint64_t> revision,
                                      const ReadSettings& settings, const SurfaceOptions& options) {
  const auto begin = Clock::now();
  if (!is_ply(path)) return make_error(ErrorCode::kInvalidArgument, path + ": a mesh is written as .ply");
  SurfaceReport report;
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  MAPCODEC_ASSIGN(const Gathered g, gather(map, region, settings, report));
  report.tolerance_m = slit_width(map, g, options);
  SurfaceMesh mesh = weld_patches(g.patches, report.tolerance_m);
  orient_faces(mesh);
  MeshWriteOptions write;
  write.ascii = options.ascii;
  write.doubles = map.schema().coordinates.kind != CoordinateFormat::Kind::f32;
  MAPCODEC_TRY(write_mesh_ply(path, mesh, write));
  report.vertices = mesh.vertices.size();
  report.faces = mesh.faces.size();
  report.seconds = seconds_since(begin);
  return report;
}

}  // namespace mapcodec
