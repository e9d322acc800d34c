// SPDX-License-Identifier: GPL-3.0-or-later
// Localises a scan in a map, the way a SLAM program would: hold the map around the guess, register, print.
// Exit code 0: found; 1: not; 2: wrong arguments.
#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <chrono>

#include "slam_adapter/formats/formats.hpp"
#include "tools/examples/registration.hpp"

namespace {

using namespace mapcodec;
using namespace mapcodec::examples;

struct Arguments {
  std::string map, scan, method = "patches";
  std::vector<double> guess{0, 0, 0, 0, 0, 0};
  double unit_m = 1, memory_mb = 256;
  LocalMapSettings local;
  RegistrationSettings registration;
  int threads = 0;
};

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Result<std::vector<Vec3>> read_scan(const std::string& path, double unit_m) {
  ReadOptions options;
  options.unit_m = unit_m;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_source(path, options));
  std::vector<Vec3> points;
  for (PointCloud block;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) return points;
    points.insert(points.end(), block.xyz.begin(), block.xyz.end());
  }
}

Eigen::Isometry3d pose_of_numbers(const std::vector<double>& v) {
  constexpr double kDegree = 3.14159265358979323846 / 180;
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.translate(Eigen::Vector3d(v[0], v[1], v[2]));
  t.rotate(Eigen::AngleAxisd(v[5] * kDegree, Eigen::Vector3d::UnitZ()));
  t.rotate(Eigen::AngleAxisd(v[4] * kDegree, Eigen::Vector3d::UnitY()));
  t.rotate(Eigen::AngleAxisd(v[3] * kDegree, Eigen::Vector3d::UnitX()));
  return t;
}

Result<Registration> run_method(const Arguments& a, const std::vector<Vec3>& scan, const LocalMapView& view) {
  const Eigen::Isometry3d guess = pose_of_numbers(a.guess);
  if (a.method == "gicp") return register_gicp(scan, view, guess, a.registration);
  if (a.method == "ndt") return register_ndt(scan, view, guess, a.registration);
  return register_to_planes(scan, view, guess, a.method == "patches" ? Partner::patches : Partner::points,
                            a.registration);
}

Status localize(Arguments a) {
  Arena arena(a.threads);
  a.local.memory_bytes = static_cast<std::uint64_t>(a.memory_mb * 1e6);
  a.local.content.patches = a.method == "patches";
  a.local.content.points = !a.local.content.patches;
  MAPCODEC_ASSIGN(const std::vector<Vec3> scan, read_scan(a.scan, a.unit_m));
  const double begin = now_s();
  MAPCODEC_ASSIGN(const std::unique_ptr<LocalMap> map, LocalMap::open(a.map, a.local, arena));
  MAPCODEC_TRY(map->move_to(to_pose(pose_of_numbers(a.guess))));
  MAPCODEC_ASSIGN(const bool ready, map->wait_ready(600));
  if (!ready) return make_error(ErrorCode::kCancelled, a.map + ": the map was not loaded in ten minutes");
  const auto view = map->view();
  for (const auto& f : view->faults()) fmt::print(stderr, "{}: {}\n", a.map, f.error.to_string());
  const double loaded = now_s();
  MAPCODEC_ASSIGN(const Registration r, run_method(a, scan, *view));
  const double done = now_s();
  const MapPose p = to_pose(r.T_map_scan);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  fmt::print("position_m {:.6f} {:.6f} {:.6f}\n", p.translation_m[0], p.translation_m[1], p.translation_m[2]);
  fmt::print("rotation_xyzw {:.9f} {:.9f} {:.9f} {:.9f}\n", p.rotation_xyzw[0], p.rotation_xyzw[1],
             p.rotation_xyzw[2], p.rotation_xyzw[3]);
  fmt::print("converged {}\niterations {}\nmatched {} of {}\nrms_m {:.6f}\n", r.converged ? "yes" : "no",
             r.iterations, r.matched, r.points, r.rms_m);
  fmt::print(
      "map_tiles {}\nmap_points {}\nmap_patches {}\nmap_mb {:.3f}\npeak_mb {:.3f}\nprocess_mb {:.1f}\n",
      view->tiles().size(), view->points(), view->patches(), double(view->bytes()) / 1e6,
      double(map->memory().peak) / 1e6, double(usage.ru_maxrss) / 1024);
  fmt::print("load_s {:.4f}\nregister_s {:.4f}\n", loaded - begin, done - loaded);
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Localises a scan in a map: prints its pose, times and memory");
  Arguments a;
  app.add_option("MAP", a.map, "Map archive")->required();
  app.add_option("SCAN", a.scan, "Point file in the sensor's frame")->required();
  app.add_option("--guess", a.guess, "x y z [m] roll pitch yaw [degrees]: T_map_scan, about")->expected(6);
  app.add_option("--method", a.method, "patches: stored surfaces, points: planes of points, gicp, ndt: PCL")
      ->check(CLI::IsMember({"patches", "points", "gicp", "ndt"}));
  app.add_option("--radius", a.local.radius_m, "Of the local map [m]");
  app.add_option("--memory", a.memory_mb, "Budget of the local map [MB]");
  app.add_option("--reach", a.registration.reach_m, "Largest error of the guess, about [m]");
  app.add_option("--voxel", a.registration.scan_voxel_m,
                 "Thin the scan to one point per voxel of this side [m]");
  app.add_option("--map-voxel", a.registration.map_voxel_m, "The same for the map")
      ->check(CLI::PositiveNumber);
  app.add_option("--unit", a.unit_m, "Metres per unit of the scan");
  app.add_option("--threads", a.threads, "0: all cores")->check(CLI::Range(0, 1024));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  const Status s = localize(std::move(a));
  if (s.ok()) return 0;
  fmt::print(stderr, "localize: {}\n", s.error().to_string());
  return 1;
}
