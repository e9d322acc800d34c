// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/decompress.hpp"

#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, output, box, sphere, as = "points", progress = "auto";
  std::optional<std::uint64_t> revision;
  int threads = 0;
  bool json = false, force = false;
  WriteOptions write;
};

Result<Region> region_of(const Arguments& a) {
  Region r;
  if (!a.box.empty()) {
    MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(a.box, 6));
    r.box = Box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
    for (std::size_t d = 0; d < 3; ++d) {
      if (v[d] > v[d + 3])
        return make_error(ErrorCode::kInvalidArgument, "--box has a minimum above its maximum");
    }
  }
  if (!a.sphere.empty()) {
    MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(a.sphere, 4));
    if (v[3] < 0) return make_error(ErrorCode::kInvalidArgument, "--sphere has a negative radius");
    r.sphere = Region::Sphere{{v[0], v[1], v[2]}, v[3]};
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

int run(const Arguments& a) {
  if (a.as != "points") {
    return fail(a.map, make_error(ErrorCode::kUnsupported, "--as " + a.as +
                                                               " needs surface tiles, which this version "
                                                               "does not have yet"));
  }
  const auto region = region_of(a);
  if (!region.ok()) return fail("decompress", region.error());
  if (!a.force && path_exists(a.output)) {
    return fail(a.output, make_error(ErrorCode::kCannotWrite, "exists already (--force replaces it)"));
  }
  Arena arena(a.threads);
  ReadSettings settings;
  settings.arena = &arena;
  settings.progress = progress_printer(a.progress);
  settings.stop = stop_flag();
  const auto r = decompress(a.map, a.output, *region, a.revision, settings, a.write);
  settings.progress = {};
  if (!r.ok()) return fail(r.error().code == ErrorCode::kCannotWrite ? a.output : a.map, r.error());
  if (a.json) {
    fmt::print("{}\n", report_json(*r).dump(2));
  } else {
    fmt::print("{}: {} points from {} tiles, {} read, {:.3f} s, first point after {:.1f} ms\n", a.output,
               human_count(r->points), r->tiles_read, human_bytes(r->bytes_read), r->seconds,
               1e3 * r->first_point_seconds);
  }
  return kDone;
}

}  // namespace

void add_decompress(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("decompress", "An archive in; points out");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("-o,--output", a->output, "File to write: .pcd .ply .las .xyz .txt .pts .bin .vtk")
      ->required();
  auto* box = verb->add_option("--box", a->box, "Only points in x0,y0,z0,x1,y1,z1 [m]");
  verb->add_option("--sphere", a->sphere, "Only points in x,y,z,r [m]")->excludes(box);
  verb->add_option("--revision", a->revision, "As the map was at revision N");
  verb->add_option("--as", a->as, "points, planes or mesh")
      ->check(CLI::IsMember({"points", "planes", "mesh"}));
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
