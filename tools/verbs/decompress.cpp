// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/decompress.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>

#include "slam_adapter/autoware/autoware_folder.hpp"
#include "slam_adapter/mrpt/simplemap_file.hpp"
#ifdef MAPCODEC_OCTOMAP
#include "slam_adapter/octomap/octomap_tree.hpp"
#endif
#include "slam_adapter/octomap/octree_jobs.hpp"
#include "slam_adapter/planes_file.hpp"
#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, output, box, sphere, revision_name, as = "points", progress = "auto";
  std::optional<std::uint64_t> revision;
  std::optional<unsigned> level;
  SurfaceOptions surfaces;
  AutowareExport autoware;
  int threads = 0;
  bool json = false, force = false;
  WriteOptions write;
  std::string origin;  ///< --as bt
  double resolution_m = 0.1, max_range_m = -1;
};

Result<Region> region_of(const Arguments& a) {
  Region r;
  if (!a.box.empty()) {
    MAPCODEC_ASSIGN(r.box, parse_box(a.box));
  }
  if (!a.sphere.empty()) {
    MAPCODEC_ASSIGN(r.sphere, parse_sphere(a.sphere));
  }
  return r;
}

Json report_json(const DecompressReport& r) {
  return {{"points", r.points},
          {"tiles_read", r.tiles_read},
          {"bytes_read", r.bytes_read},
          {"decode_seconds", r.seconds},
          {"first_point_seconds", r.first_point_seconds},
          {"points_per_second", r.seconds > 0 ? double(r.points) / r.seconds : 0},
          {"peak_memory_bytes", peak_memory_bytes()}};
}

Json report_json(const SurfaceReport& r, bool planes) {
  Json j{{"points", r.points},
         {"patch_points", r.patch_points},
         {"patches", r.patches},
         {"tiles_read", r.tiles_read},
         {"tiles_without_surfaces", r.tiles_without},
         {"bytes_read", r.bytes_read},
         {"tolerance_m", r.tolerance_m},
         {"decode_seconds", r.seconds}};
  if (planes) {
    j["planes"] = r.planes;
    j["plane_points"] = r.plane_points;
    j["cylinders"] = r.cylinders;
    j["cylinder_points"] = r.cylinder_points;
  } else {
    j["vertices"] = r.vertices;
    j["faces"] = r.faces;
  }
  j["peak_memory_bytes"] = peak_memory_bytes();
  return j;
}

std::string report_text(const SurfaceReport& r, bool planes) {
  if (!planes) {
    return fmt::format("{} triangles over {} vertices from {} patches", human_count(r.faces),
                       human_count(r.vertices), human_count(r.patches));
  }
  std::string s = fmt::format("{} planes", human_count(r.planes));
  if (r.cylinders > 0) s += fmt::format(" and {} cylinders", human_count(r.cylinders));
  return s + fmt::format(" with {:.1f} % of the points, from {} patches",
                         100.0 * double(r.plane_points + r.cylinder_points) /
                             double(std::max<std::uint64_t>(1, r.points)),
                         human_count(r.patches));
}

int fail_decompress(const Arguments& a, const Error& error) {
  return fail(error.code == ErrorCode::kCannotWrite ? a.output : a.map, error);
}

#ifdef MAPCODEC_OCTOMAP
Result<DecompressReport> insert_and_write(const Arguments& a, const Region& region,
                                          const ReadSettings& settings) {
  const auto begin = std::chrono::steady_clock::now();
  RaySettings rays;
  rays.resolution_m = a.resolution_m;
  rays.max_range_m = a.max_range_m;
  if (!a.origin.empty()) {
    MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(a.origin, 3));
    rays.origin_m = Vec3{v[0], v[1], v[2]};
  }
  if (!is_octree_name(a.output))
    return make_error(ErrorCode::kInvalidArgument, "--as bt writes a file whose name ends in .bt or .ot");
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(a.map, a.revision));
  MAPCODEC_ASSIGN(const OccupancyTree tree, insert_rays(map, region, rays, settings));
  MAPCODEC_TRY(write_octree(a.output, tree, a.resolution_m));
  DecompressReport r;
  r.points = tree.leaf_count();
  r.tiles_read = map.tiles_in(region).size();
  r.bytes_read = map.archive().bytes_read();
  r.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return r;
}
#else
Result<DecompressReport> insert_and_write(const Arguments&, const Region&, const ReadSettings&) {
  return make_error(ErrorCode::kUnsupported, "this build has no OctoMap, which --as bt needs");
}
#endif

int write_points(const Arguments& a, const Region& region, const ReadSettings& settings) {
  const auto r = a.as == "bt"               ? insert_and_write(a, region, settings)
                 : is_octree_name(a.output) ? decompress_octree(a.map, a.output, region, a.revision, settings)
                 : is_simplemap_name(a.output)
                     ? decompress_simplemap(a.map, a.output, a.revision, settings)
                     : decompress(a.map, a.output, region, a.revision, settings, a.write);
  if (!r.ok()) return fail_decompress(a, r.error());
  if (a.json) {
    fmt::print("{}\n", report_json(*r).dump(2));
  } else {
    fmt::print("{}: {} points from {} tiles, {} read, {:.3f} s, first point after {:.1f} ms\n", a.output,
               human_count(r->points), r->tiles_read, human_bytes(r->bytes_read), r->seconds,
               1e3 * r->first_point_seconds);
  }
  return kDone;
}

int write_autoware(const Arguments& a, const Region& region, const ReadSettings& settings) {
  AutowareExport options = a.autoware;
  options.write = a.write;
  options.overwrite = a.force;
  const auto r = export_autoware(a.map, a.output, region, a.revision, settings, options);
  if (!r.ok()) return fail_decompress(a, r.error());
  for (const std::string& warning : r->warnings) spdlog::warn("note: {}", warning);
  if (a.json) {
    Json j = report_json(*r);
    j["tiles_written"] = r->tiles;
    j["warnings"] = r->warnings;
    fmt::print("{}\n", j.dump(2));
  } else {
    fmt::print("{}: {} points in {} tiles of {:g} m, {:.3f} s\n", a.output, human_count(r->points), r->tiles,
               options.tile_size_m, r->seconds);
  }
  return kDone;
}

int write_surfaces(const Arguments& a, const Region& region, const ReadSettings& settings) {
  const bool planes = a.as == "planes";
  SurfaceOptions options = a.surfaces;
  options.ascii = a.write.ascii;
  const auto r =
      (planes ? decompress_planes : decompress_mesh)(a.map, a.output, region, a.revision, settings, options);
  if (!r.ok()) return fail_decompress(a, r.error());
  if (a.json) {
    fmt::print("{}\n", report_json(*r, planes).dump(2));
  } else {
    fmt::print("{}: {}, {:.3f} s\n", a.output, report_text(*r, planes), r->seconds);
  }
  if (r->tiles_without > 0) {
    fmt::print(stderr, "mapcodec: {}: {} of {} tiles keep points, not surfaces: they are left out\n", a.map,
               r->tiles_without, r->tiles_read);
  }
  return kDone;
}

/// What cannot be asked together, in one sentence; empty if all is well.
std::string contradiction(const Arguments& a) {
  if (a.as != "bt" && !a.origin.empty()) return "--origin is for --as bt";
  if (a.as != "points" && a.level) return "--level is for --as points";
  if (a.as != "planes" && a.surfaces.cylinders) return "--cylinders is for --as planes";
  if (a.as != "points" && a.as != "autoware" && a.write.compressed)
    return "--binary-compressed is for --as points or autoware";
  if ((a.as == "points" || a.as == "autoware") && a.surfaces.tolerance_m > 0)
    return "--tolerance is for --as planes or mesh";
  if (is_simplemap_name(a.output) && (a.as != "points" || a.level || !a.box.empty() || !a.sphere.empty()))
    return "a simplemap holds whole keyframes of points: without --as, --level, --box, --sphere";
  return {};
}

int run(Arguments& a) {
  if (const std::string wrong = contradiction(a); !wrong.empty()) {
    fmt::print(stderr, "mapcodec: decompress: {}\n", wrong);
    return kUsage;
  }
  const auto region = region_of(a);
  if (!region.ok()) return fail("decompress", region.error());
  if (!a.force && a.as != "autoware" && path_exists(a.output)) {
    return fail(a.output, make_error(ErrorCode::kCannotWrite, "exists already (--force replaces it)"));
  }
  if (!a.revision_name.empty()) {
    const auto archive = MapArchive::open(a.map);
    const auto number = archive.ok() ? archive->resolve(a.revision_name) : archive.error();
    if (!number.ok()) return fail(a.map, number.error());
    a.revision = *number;
  }
  Arena arena(a.threads);
  ReadSettings settings;
  settings.arena = &arena;
  settings.progress = progress_printer(a.progress);
  settings.stop = stop_flag();
  settings.level = a.level;
  if (a.as == "autoware") return write_autoware(a, *region, settings);
  return (a.as == "points" || a.as == "bt" ? write_points : write_surfaces)(a, *region, settings);
}

}  // namespace

void add_decompress(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("decompress", "An archive in; points, planes or a mesh out");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option(
          "-o,--output", a->output,
          "File to write: .pcd .ply .las .xyz .txt .pts .bin .vtk, of octrees .bt .ot, .simplemap (MRPT, a "
          "keyframe per submap); planes: JSON; mesh: .ply; autoware: a folder")
      ->required();
  auto* box = verb->add_option("--box", a->box, "Only points in x0,y0,z0,x1,y1,z1 [m]");
  verb->add_option("--sphere", a->sphere, "Only points in x,y,z,r [m]")->excludes(box);
  verb->add_option("--revision", a->revision_name,
                   "As the map was at revision N, or at the snapshot of that name");
  verb->add_option("--level", a->level,
                   "Points in less detail: cells of the tile size halved N times (info lists the levels); "
                   "without channels")
      ->check(CLI::Range(0u, kMostTileLevel));
  verb->add_option(
          "--as", a->as,
          "points, planes (JSON), mesh (PLY with faces), bt (points as an octree, by ray insertion) or "
          "autoware (a map folder)")
      ->check(CLI::IsMember({"points", "planes", "mesh", "bt", "autoware"}));
  verb->add_option("--tile-size-xy", a->autoware.tile_size_m, "--as autoware: sides of its tiles [whole m]")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  verb->add_option("--resolution", a->resolution_m, "--as bt: side of a voxel [m]")
      ->check(CLI::Range(1e-6, 1e6))
      ->capture_default_str();
  verb->add_option(
      "--origin", a->origin,
      "--as bt: where the sensor stood, as x,y,z [m], for points without a submap (submaps: their poses); "
      "without it nothing is free");
  verb->add_option("--max-range", a->max_range_m, "--as bt: longer rays are cut there [m]")
      ->check(CLI::PositiveNumber);
  verb->add_option(
          "--tolerance", a->surfaces.tolerance_m,
          "How far a plane's pieces may lie off it, and how wide the slits of a mesh that are closed "
          "[m] (default: the map's step or RMS)")
      ->check(CLI::Range(1e-9, 1e6));
  verb->add_option("--least-points", a->surfaces.least_points, "Smallest plane or cylinder [points]");
  verb->add_flag("--cylinders", a->surfaces.cylinders,
                 "--as planes: cylinders, too, where they describe the points better (RANSAC: slow)");
  verb->add_flag("--ascii", a->write.ascii, "Text instead of binary (PCD, PLY, VTK)");
  verb->add_flag("--binary-compressed", a->write.compressed, "PCD: the binary_compressed form");
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_option("--progress", a->progress, "auto, bar, plain, json or none, on stderr")
      ->check(CLI::IsMember({"auto", "bar", "plain", "json", "none"}));
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->add_flag("--force", a->force, "Replace an existing output");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
