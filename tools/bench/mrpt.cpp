// SPDX-License-Identifier: GPL-3.0-or-later
// Every rawlog and simplemap of a folder: read, compressed, written back, beside what MRPT itself reads; and
// logs without poses, registered and compared with the points that MRPT accumulates along the same way.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "tools/bench/bench.hpp"
#include "tools/bench/child.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;
using bench::Json;
using bench::json_of;
using bench::output_of;

class MrptBench {
 public:
  MrptBench(const BenchSettings& settings, bench::Report& report) : settings_(settings), report_(report) {
    mapcodec_ = bench::own_path();
    peer_ = (fs::path(mapcodec_).parent_path() / "mrpt_peer").string();
    map_ = settings.report + "/scratch.mapc";
  }

  Status run() {
    std::error_code ignored;
    if (!fs::exists(peer_, ignored))
      return make_error(ErrorCode::kUnsupported,
                        "mrpt_peer is not beside this program: build with MAPCODEC_MRPT");
    const std::vector<std::string> files = find();
    if (files.empty()) return make_error(ErrorCode::kEmpty, "holds no rawlog and no simplemap");
    MAPCODEC_TRY(compare_all(files));
    MAPCODEC_TRY(register_all(files));
    fs::remove(map_, ignored);
    return {};
  }

 private:
  std::vector<std::string> find() const {
    std::vector<std::string> files;
    std::error_code ignored;
    for (const auto& e : fs::recursive_directory_iterator(settings_.data, ignored)) {
      const std::string path = e.path().string();
      const bool wanted = settings_.files.empty() ||
                          std::any_of(settings_.files.begin(), settings_.files.end(),
                                      [&](const std::string& part) { return path.find(part) != path.npos; });
      if (wanted && (path.find(".rawlog") != path.npos || path.find(".simplemap") != path.npos))
        files.push_back(path);
    }
    std::sort(files.begin(), files.end());
    return files;
  }

  static std::string short_name(const std::string& path) { return fs::path(path).filename().string(); }

  /// Largest difference between two boxes [m].
  static double difference(const Json& a, const Json& b) {
    double most = 0;
    for (std::size_t d = 0; d < 3; ++d) {
      most = std::max(most, std::abs(a["bounds"]["min"][d].get<double>() - b["min"][d].get<double>()));
      most = std::max(most, std::abs(a["bounds"]["max"][d].get<double>() - b["max"][d].get<double>()));
    }
    return most;
  }

  Status compare_all(const std::vector<std::string>& files) {
    report_.line(
        "Read and written back; `--max-error 0.001 --color-error 0`, written back as a simplemap.\n");
    report_.table({"file", "bytes", "MRPT: observations", "MRPT: points", "ours", "bounds differ [mm]",
                   "archive", "with MRPT again"});
    for (const std::string& f : files) {
      settings_.say("mrpt: " + short_name(f));
      MAPCODEC_TRY(compare(f));
    }
    report_.line("");
    return {};
  }

  Status compare(const std::string& file) {
    const auto own = json_of({peer_, file});
    const auto ours = json_of({mapcodec_, "compress", file, "-o", map_, "--max-error", "0.001",
                               "--color-error", "0", "--json", "--force"});
    if (!own.ok() || !ours.ok()) {
      report_.row({short_name(file), "-", own.ok() ? "read" : "not read", "-",
                   ours.ok() ? "read" : "not read", "-", "-", "-"});
      return {};
    }
    const std::string back = settings_.report + "/scratch.simplemap";
    MAPCODEC_TRY(output_of({mapcodec_, "decompress", map_, "-o", back, "--force"}));
    MAPCODEC_ASSIGN(const Json again, json_of({peer_, back}));
    std::error_code ignored;
    fs::remove(back, ignored);
    Json row{{"file", short_name(file)},
             {"bytes", fs::file_size(file, ignored)},
             {"mrpt", *own},
             {"points", (*ours)["points"]},
             {"bounds_difference_m", difference(*ours, *own)},
             {"archive_bytes", (*ours)["bytes"]},
             {"written_back", again}};
    report_.row({short_name(file), std::to_string(row["bytes"].get<std::uint64_t>()),
                 (*own)["observations"].dump(), (*own)["points"].dump(), (*ours)["points"].dump(),
                 bench::digits(1e3 * row["bounds_difference_m"].get<double>()), (*ours)["bytes"].dump(),
                 again["points"].dump()});
    report_.json()["files"].push_back(std::move(row));
    return {};
  }

  Status register_all(const std::vector<std::string>& files) {
    report_.line(
        "Logs of several observations without poses: `rawlog --poses icp --rms 0.01`, and the points that "
        "MRPT "
        "accumulates along the same way.\n");
    report_.table({"file", "keyframes", "points", "MRPT: points", "archive", "bits per point", "ratio",
                   "RMS measured [mm]", "colour error"});
    for (const std::string& f : files) {
      if (f.find(".rawlog") == f.npos) continue;
      MAPCODEC_TRY(register_log(f));
    }
    return {};
  }

  Status register_log(const std::string& file) {
    const std::string way = settings_.report + "/" + short_name(file) + ".tum";
    const std::string points = settings_.report + "/scratch.xyz";
    const auto map = json_of({mapcodec_, "rawlog", file, "-o", map_, "--poses", "icp", "--rms", "0.01",
                              "--force", "--json", "--trajectory", way});
    if (!map.ok() || (*map)["keyframes"].get<int>() < 2) return {};
    settings_.say("mrpt: registered " + short_name(file));
    MAPCODEC_ASSIGN(const Json own, json_of({peer_, file, "--poses", way, "--map", points}));
    MAPCODEC_ASSIGN(const Json e, json_of({mapcodec_, "evaluate", points, map_, "--json"}));
    std::error_code ignored;
    fs::remove(points, ignored);
    report_.row({short_name(file), (*map)["keyframes"].dump(), (*map)["points"].dump(), own["points"].dump(),
                 (*map)["bytes"].dump(), bench::digits((*map)["bits_per_point"].get<double>()),
                 bench::digits((*map)["ratio"].get<double>()),
                 bench::digits(1e3 * e["rms_m"].get<double>(), 4),
                 e["color_error"].is_number() ? bench::digits(e["color_error"].get<double>()) : "-"});
    report_.json()["registered"].push_back(
        {{"file", short_name(file)}, {"map", *map}, {"mrpt", own}, {"evaluation", e}});
    return {};
  }

  const BenchSettings& settings_;
  bench::Report& report_;
  std::string mapcodec_, peer_, map_;
};

}  // namespace

Status bench_mrpt(const BenchSettings& settings) {
  bench::Report report(settings, "mrpt", settings.threads);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_TRY(MrptBench(settings, report).run());
  return report.finish();
}

}  // namespace mapcodec
