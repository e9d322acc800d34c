// SPDX-License-Identifier: GPL-3.0-or-later
// Localisation in compressed maps against localisation in the same map uncompressed.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>

#include "mapcodec/cloud/cloud_source.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/scan_folder.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/local.hpp"
#include "tools/bench/log_scans.hpp"
#include "tools/examples/registration.hpp"

namespace mapcodec::bench {
namespace {

using Eigen::Isometry3d;
using examples::Partner;
using examples::Registration;

/// The first scan is the map's frame (of a log: the log's is); those between are put into the map where they
/// fit the first, and the last is localised. Guesses of T_first_scan: x, y, z [m], yaw [degrees].
struct Sequence {
  const char* name;
  std::vector<const char*> scans;
  std::vector<std::array<double, 4>> guesses;
  double reach_m;
  double range_m = 1e9;  ///< what is farther is no return
  bool posed = false;    ///< the scans lie where the log says: they go into the map without being registered
};
const std::vector<Sequence> kSequences{
    {"3DTK corridor", {"dat/scan000.3d", "dat/scan001.3d", "dat/scan002.3d"}, {}, 1.0, 30},
    {"room (PCL)", {"room_scan1.pcd", "room_scan2.pcd"}, {{0, 0, 0, 0}, {1.79387, 0.720047, 0, 39.7}}, 1.0},
    {"street (small_gicp)", {"small_gicp/data/target.ply", "small_gicp/data/source.ply"}, {}, 1.5},
    {"room (libpointmatcher)", {"icp_tutorial/cloud_0.vtk", "icp_tutorial/cloud_1.vtk"}, {}, 1.0},
    {"car (libpointmatcher)",
     {"data/cloud.00000.vtk", "data/cloud.00001.vtk", "data/cloud.00002.vtk"},
     {},
     2.0},
    {"simplemap (MRPT)", {"hku_mlcc_scene2_L1_12kf.simplemap"}, {}, 1.0, 1e9, true},
    {"HDL-32 (MRPT)", {"sample_velodyne_hdl32.rawlog"}, {}, 1.0, 1e9, true}};

/// What is varied against the raw map: its coding, or, to know what a difference says, nothing but the guess
/// or the choice of points.
enum class Vary { nothing, guess, half, coding };
struct MapKind {
  const char* name;
  Vary vary;
  PromiseKind promise;
  double promise_m;
  CodecChoice codecs;
};
constexpr MapKind kKinds[] = {
    {"raw", Vary::nothing, PromiseKind::lossless, 0, CodecChoice::cheapest},
    {"raw, other guesses", Vary::guess, PromiseKind::lossless, 0, CodecChoice::cheapest},
    {"raw, half of it", Vary::half, PromiseKind::lossless, 0, CodecChoice::cheapest},
    {"--rms 0.01", Vary::coding, PromiseKind::rms, 0.01, CodecChoice::cheapest},
    {"--rms 0.01 surface", Vary::coding, PromiseKind::rms, 0.01, CodecChoice::surface},
    {"--max-error 0.005", Vary::coding, PromiseKind::max_error, 0.005, CodecChoice::cheapest}};
/// T_guess_other: x, y, z [m], yaw [degrees].
constexpr std::array<double, 4> kOtherGuesses[] = {
    {0.2, -0.1, 0.05, 1}, {-0.2, 0.1, -0.05, -1}, {0.1, 0.2, -0.05, 0.5}, {-0.1, -0.2, 0.05, -0.5}};

enum class Method { planes, gicp, ndt, patches };
constexpr const char* kMethodNames[] = {"planes of points", "GICP", "NDT", "stored patches"};
constexpr Method kMethods[] = {Method::planes, Method::gicp, Method::ndt, Method::patches};

struct Outcome {
  Registration registration;
  double load_ms = 0, seconds = 0;
  std::uint64_t peak = 0, held = 0;
};

Result<std::vector<Vec3>> finite_points(const std::string& path, double range_m) {
  MAPCODEC_ASSIGN(BenchCloud cloud, load_cloud(path));
  // Some sensors write 0 0 0, others their longest range where nothing came back: a ball around the sensor
  // that goes with it.
  std::erase_if(cloud.cloud.xyz, [&](const Vec3& p) {
    return !is_finite(p) || p == Vec3{0, 0, 0} || std::hypot(p[0], p[1], p[2]) > range_m;
  });
  return std::move(cloud.cloud.xyz);
}

Isometry3d pose_of(const std::array<double, 4>& g) {
  Isometry3d t = Isometry3d::Identity();
  t.translate(Eigen::Vector3d(g[0], g[1], g[2]));
  t.rotate(Eigen::AngleAxisd(g[3] * 3.14159265358979323846 / 180, Eigen::Vector3d::UnitZ()));
  return t;
}

/// 3DTK's pose beside a scan, [m]; nothing where there is none.
std::optional<Isometry3d> pose_beside(const std::string& path) {
  const auto stream = file_stream(std::filesystem::path(path).replace_extension(".pose").string());
  if (!stream.ok()) return std::nullopt;
  const auto pose = read_scan_pose(**stream);
  if (!pose.ok()) return std::nullopt;
  Isometry3d t = Isometry3d::Identity();
  for (int r = 0; r < 3; ++r) {
    const auto row = static_cast<std::size_t>(r);
    for (int c = 0; c < 3; ++c) t.linear()(r, c) = pose->rows[row][static_cast<std::size_t>(c)];
    t.translation()(r) = 0.01 * pose->translation[row];
  }
  return t;
}

Result<Registration> register_scan(const std::vector<Vec3>& scan, const LocalMapView& view,
                                   const Isometry3d& guess, Method method,
                                   const examples::RegistrationSettings& settings) {
  switch (method) {
    case Method::gicp:
      return examples::register_gicp(scan, view, guess, settings);
    case Method::ndt:
      return examples::register_ndt(scan, view, guess, settings);
    case Method::planes:
      return examples::register_to_planes(scan, view, guess, Partner::points, settings);
    case Method::patches:
      break;
  }
  return examples::register_to_planes(scan, view, guess, Partner::patches, settings);
}

Result<Outcome> localise(LocalBench& b, const std::vector<Vec3>& scan, const Isometry3d& guess, Method method,
                         double reach_m) {
  LocalMapSettings s;
  s.radius_m = 100;
  s.memory_bytes = 1'000'000'000;
  s.ahead_s = 0;
  s.content.patches = method == Method::patches;
  s.content.points = !s.content.patches;
  const double begin = wall_s();
  MAPCODEC_ASSIGN(const auto map, LocalMap::open(b.report.scratch(), s, b.arena));
  MAPCODEC_TRY(map->move_to(examples::to_pose(guess)));
  MAPCODEC_ASSIGN(const bool ready, map->wait_ready(60));
  if (!ready) return make_error(ErrorCode::kCancelled, "not loaded in a minute");
  const auto view = map->view();
  examples::RegistrationSettings r;
  r.reach_m = reach_m;
  Outcome o;
  const double loaded = wall_s();
  MAPCODEC_ASSIGN(o.registration, register_scan(scan, *view, guess, method, r));
  o.seconds = wall_s() - loaded;
  o.load_ms = 1e3 * (loaded - begin);
  o.peak = map->memory().peak;
  o.held = view->bytes();
  return o;
}

class Localisation {
 public:
  explicit Localisation(LocalBench& bench) : b_(bench) {}

  Status run(const Sequence& sequence) {
    b_.settings.say(fmt::format("localisation: {}", sequence.name));
    MAPCODEC_TRY(read(sequence));
    Isometry3d last = Isometry3d::Identity();
    for (std::size_t i = 1; i < scans_.size(); ++i) {
      const Isometry3d guess = guess_of(sequence, i);
      if (i + 1 == scans_.size()) {
        last = guess;
        break;
      }
      if (sequence.posed) {
        add(scans_[i], guess);
        continue;
      }
      MAPCODEC_TRY(write_map(kKinds[0], map_));
      MAPCODEC_ASSIGN(const Outcome o, localise(b_, scans_[i], guess, Method::planes, sequence.reach_m));
      add(scans_[i], o.registration.T_map_scan);
    }
    b_.print("");
    b_.print(fmt::format("{}: {} points in the map, {} in the scan", sequence.name, map_.size(),
                         scans_.back().size()));
    b_.print(fmt::format("{:>19} {:>9} {:>17} {:>8} {:>8} {:>7} {:>8} {:>9} {:>8} {:>8}", "map", "kB",
                         "method", "mm", "mrad", "load ms", "s", "matched", "held MB", "peak MB"));
    return measure(sequence, last);
  }

 private:
  /// A log is taken apart into its keyframes.
  Result<std::vector<std::string>> paths_of(const Sequence& sequence) const {
    std::vector<std::string> paths;
    for (const char* part : sequence.scans) {
      MAPCODEC_ASSIGN(std::string path, path_named(b_.settings, part));
      paths.push_back(std::move(path));
    }
    if (paths.size() > 1) return paths;
    MAPCODEC_ASSIGN(paths, scans_of_log(paths.front(), b_.settings.report + "/scans"));
    // One from the middle, which others overlap on both sides.
    std::swap(paths[paths.size() / 2], paths.back());
    return paths;
  }

  Status read(const Sequence& sequence) {
    scans_.clear();
    paths_.clear();
    map_ = {};
    MAPCODEC_ASSIGN(paths_, paths_of(sequence));
    for (const std::string& path : paths_) {
      MAPCODEC_ASSIGN(std::vector<Vec3> points, finite_points(path, sequence.range_m));
      scans_.push_back(std::move(points));
    }
    map_.xyz.clear();
    add(scans_.front(), Isometry3d::Identity());
    return {};
  }

  Isometry3d guess_of(const Sequence& sequence, std::size_t i) const {
    if (i < sequence.guesses.size()) return pose_of(sequence.guesses[i]);
    const auto first = pose_beside(paths_.front()), here = pose_beside(paths_[i]);
    return first && here ? first->inverse() * *here : Isometry3d::Identity();
  }

  void add(const std::vector<Vec3>& scan, const Isometry3d& T_map_scan) {
    for (const Vec3& p : scan) {
      const Eigen::Vector3d q = T_map_scan * Eigen::Vector3d(p[0], p[1], p[2]);
      // As a float32 file would hold it, so that "raw" is what a point file is.
      map_.xyz.push_back({double(float(q[0])), double(float(q[1])), double(float(q[2]))});
    }
  }

  Status write_map(const MapKind& kind, const PointCloud& map) {
    CompressOptions o;
    o.promise = kind.promise;
    o.promise_m = kind.promise_m;
    o.codecs = kind.codecs;
    o.overwrite = true;
    o.channels = {"none"};
    o.threads = b_.arena.threads();
    CloudSource source(map);
    const auto done = compress(source, b_.report.scratch(), o);
    return done.ok() ? Status{} : Status(done.error());
  }

  /// Every second point of the map.
  [[nodiscard]] PointCloud half(std::size_t first) const {
    PointCloud r;
    for (std::size_t i = first; i < map_.size(); i += 2) r.xyz.push_back(map_.xyz[i]);
    return r;
  }

  Status measure(const Sequence& sequence, const Isometry3d& guess) {
    reference_ = {};
    for (const MapKind& kind : kKinds) {
      if (kind.vary == Vary::half) {
        MAPCODEC_TRY(measure_halves(sequence, kind, guess));
        continue;
      }
      if (kind.vary != Vary::guess) MAPCODEC_TRY(write_map(kind, map_));
      for (const Method method : kMethods) {
        if (!is_for(kind, method)) continue;
        std::vector<Isometry3d> guesses{guess};
        if (kind.vary == Vary::guess) {
          guesses.clear();
          for (const auto& other : kOtherGuesses) guesses.push_back(guess * pose_of(other));
        }
        std::vector<Result<Outcome>> all;
        for (const Isometry3d& g : guesses)
          all.push_back(localise(b_, scans_.back(), g, method, sequence.reach_m));
        auto& reference = reference_[method == Method::patches ? 0 : static_cast<std::size_t>(method)];
        if (kind.vary == Vary::nothing && all[0].ok()) reference = all[0]->registration.T_map_scan;
        show(sequence, kind, method, all);
      }
    }
    return {};
  }

  Status measure_halves(const Sequence& sequence, const MapKind& kind, const Isometry3d& guess) {
    std::vector<std::vector<Result<Outcome>>> all(std::size(kMethods));
    for (const std::size_t first : {0U, 1U}) {
      MAPCODEC_TRY(write_map(kind, half(first)));
      for (std::size_t m = 0; m < all.size(); ++m) {
        if (is_for(kind, kMethods[m]))
          all[m].push_back(localise(b_, scans_.back(), guess, kMethods[m], sequence.reach_m));
      }
    }
    for (std::size_t m = 0; m < all.size(); ++m) {
      if (!all[m].empty()) show(sequence, kind, kMethods[m], all[m]);
    }
    return {};
  }

  static bool is_for(const MapKind& kind, Method method) {
    if (method == Method::patches) return kind.codecs == CodecChoice::surface;
    return method == Method::planes || examples::has_pcl();
  }

  /// Of several outcomes, the one that is farthest from the reference.
  void show(const Sequence& sequence, const MapKind& kind, Method method,
            const std::vector<Result<Outcome>>& all) {
    const char* name = kMethodNames[static_cast<std::size_t>(method)];
    const auto& reference = reference_[method == Method::patches ? 0 : static_cast<std::size_t>(method)];
    const double kilobytes = double(file_bytes(b_.report.scratch())) / 1e3;
    const Outcome* shown = nullptr;
    examples::PoseDifference d{NAN, NAN};
    for (const Result<Outcome>& o : all) {
      if (!o.ok()) {
        b_.print(fmt::format("{:>19} {:>9.1f} {:>17} {}", kind.name, kilobytes, name, o.error().message));
        return;
      }
      examples::PoseDifference here{NAN, NAN};
      if (reference) here = examples::difference(*reference, o->registration.T_map_scan);
      if (shown == nullptr || here.mm > d.mm) shown = &*o;
      d = {std::fmax(d.mm, here.mm), std::fmax(d.mrad, here.mrad)};
    }
    report(sequence, kind, name, kilobytes, *shown, d);
  }

  void report(const Sequence& sequence, const MapKind& kind, const char* method, double kilobytes,
              const Outcome& o, const examples::PoseDifference& d) {
    const Registration& r = o.registration;
    b_.print(
        fmt::format("{:>19} {:>9.1f} {:>17} {:>8.3f} {:>8.3f} {:>7.0f} {:>8.2f} {:>8.0f}% {:>8.2f} {:>8.2f}",
                    kind.name, kilobytes, method, d.mm, d.mrad, o.load_ms, o.seconds,
                    100.0 * double(r.matched) / double(std::max<std::size_t>(1, r.points)),
                    double(o.held) / 1e6, double(o.peak) / 1e6));
    b_.report.json()["localisation"].push_back({{"sequence", sequence.name},
                                                {"map", kind.name},
                                                {"kilobytes", kilobytes},
                                                {"method", method},
                                                {"load_ms", o.load_ms},
                                                {"seconds", o.seconds},
                                                {"iterations", r.iterations},
                                                {"converged", r.converged},
                                                {"matched", r.matched},
                                                {"points", r.points},
                                                {"held_bytes", o.held},
                                                {"peak_bytes", o.peak},
                                                {"difference_mm", d.mm},
                                                {"difference_mrad", d.mrad}});
  }

  LocalBench& b_;
  std::vector<std::vector<Vec3>> scans_;
  std::vector<std::string> paths_;
  PointCloud map_;
  std::array<std::optional<Isometry3d>, std::size(kMethods)> reference_;  // the raw map's results
};

}  // namespace

Status bench_localisation(LocalBench& bench) {
  bench.print("");
  bench.print(
      "Differences from the raw map's result by the same method (stored patches: by planes of points); of "
      "other guesses and halves the largest: what a difference below them says is little");
  Localisation run(bench);
  for (const Sequence& sequence : kSequences) {
    const std::vector<std::string>& only = bench.settings.files;
    const auto named = [&](const std::string& part) {
      return std::string(sequence.name).find(part) != std::string::npos;
    };
    if (!only.empty() && std::none_of(only.begin(), only.end(), named)) continue;
    const Status s = run.run(sequence);
    if (!s.ok()) bench.report.note(fmt::format("{}: {}", sequence.name, s.error().message));
  }
  std::error_code ignored;
  std::filesystem::remove_all(bench.settings.report + "/scans", ignored);
  return {};
}

}  // namespace mapcodec::bench
