// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/update.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "mapcodec/quality/evaluation.hpp"
#include "maps/compaction.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/update.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/log_scans.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec {
namespace bench {

double quantile(std::vector<double> values, double p) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(p * double(values.size())))];
}

}  // namespace bench

namespace {

using bench::digits;
using bench::Json;
using bench::Report;
using Watch = peers::StopWatch;

/// Scans of one place, in one frame where they have poses, else as they lie.
struct Sequence {
  std::string name;
  std::vector<std::string> files;
  double unit_m = 1;
};

bool is_wanted(const BenchSettings& settings, const std::string& name) {
  return settings.files.empty() ||
         std::any_of(settings.files.begin(), settings.files.end(),
                     [&](const std::string& part) { return name.find(part) != std::string::npos; });
}

/// Files below the data folder by the folder they lie in and how their names begin.
std::vector<std::string> files_of(const std::string& data, const std::string& folder,
                                  const std::string& begin) {
  std::vector<std::string> found;
  std::error_code ignored;
  using Walk = std::filesystem::recursive_directory_iterator;
  for (const auto& entry : Walk(data, std::filesystem::directory_options::skip_permission_denied, ignored)) {
    const std::string parent = entry.path().parent_path().string();
    if (entry.is_regular_file(ignored) && parent.size() >= folder.size() &&
        parent.compare(parent.size() - folder.size(), folder.size(), folder) == 0 &&
        entry.path().filename().string().rfind(begin, 0) == 0)
      found.push_back(entry.path().string());
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// Each scan of a 3DTK folder with its pose in a folder of its own, so that it can be added alone.
std::vector<std::string> single_scans(const std::vector<std::string>& files, const std::string& scratch) {
  std::vector<std::string> folders;
  std::error_code ignored;
  for (const std::string& f : files) {
    const std::filesystem::path path(f);
    if (path.extension() != ".3d") continue;
    const std::filesystem::path folder = std::filesystem::path(scratch) / path.stem();
    std::filesystem::create_directories(folder, ignored);
    std::filesystem::copy(path, folder / path.filename(), ignored);
    const auto pose = std::filesystem::path(path).replace_extension(".pose");
    std::filesystem::copy(pose, folder / pose.filename(), ignored);
    folders.push_back(folder.string());
  }
  return folders;
}

/// Logs are taken apart only where they are asked for; what cannot be read is said.
void add_log(std::vector<Sequence>& all, const BenchSettings& settings, const std::string& scratch,
             const std::string& name, const std::string& begin) {
  if (!is_wanted(settings, name)) return;
  const std::vector<std::string> logs = files_of(settings.data, "mrpt/derived", begin);
  if (logs.empty()) return;
  auto scans = bench::scans_of_log(logs.front(), scratch + "/" + begin);
  if (!scans.ok()) settings.say(name + ": " + scans.error().message);
  if (scans.ok()) all.push_back({name, *std::move(scans), 1});
}

std::vector<Sequence> find_sequences(const BenchSettings& settings, const std::string& scratch) {
  std::vector<Sequence> all;
  all.push_back({"3DTK corridor", single_scans(files_of(settings.data, "3DTK/dat", "scan"), scratch), 0.01});
  all.push_back({"libpointmatcher car", files_of(settings.data, "examples/data", "cloud."), 1});
  all.push_back({"libpointmatcher indoor", files_of(settings.data, "icp_tutorial", "cloud_"), 1});
  all.push_back({"small_gicp street", files_of(settings.data, "small_gicp/data", "source"), 1});
  const auto target = files_of(settings.data, "small_gicp/data", "target");
  all.back().files.insert(all.back().files.end(), target.begin(), target.end());
  add_log(all, settings, scratch, "MRPT simplemap", "hku_mlcc");
  add_log(all, settings, scratch, "MRPT HDL-32", "sample_velodyne");
  std::erase_if(all, [&](const Sequence& s) { return s.files.size() < 2 || !is_wanted(settings, s.name); });
  return all;
}

struct Made {
  std::uint64_t bytes = 0, points = 0;
  double seconds = 0;
  Evaluation quality;
};

Result<PointCloud> load_all(const Sequence& s) {
  PointCloud all;
  for (const std::string& f : s.files) {
    ReadOptions read;
    read.unit_m = s.unit_m;
    MAPCODEC_ASSIGN(const auto source, open_source(f, read));
    PointCloud block;
    for (;;) {
      MAPCODEC_ASSIGN(const bool more, source->next(block));
      if (!more) break;
      if (all.empty()) all = block.like();
      all.append(block);
    }
  }
  all.channels.clear();
  return all;
}

Status look_at(const std::string& path, const PointCloud& original, Made& m) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  MAPCODEC_ASSIGN(PointCloud decoded, map.read());
  decoded.channels.clear();
  m.bytes = map.archive().file_bytes();
  m.points = decoded.size();
  Arena arena(0);
  TbbRunner runner(arena);
  MAPCODEC_ASSIGN(m.quality, evaluate(original, decoded, runner, {}));
  return {};
}

CompressOptions options_of(PromiseKind kind, double value, const Sequence& s) {
  CompressOptions o;
  o.promise = kind;
  o.promise_m = value;
  o.channels = {"none"};
  o.unit_m = s.unit_m;
  o.overwrite = true;
  return o;
}

Result<Made> at_once(const Sequence& s, const CompressOptions& o, const PointCloud& original,
                     const std::string& path) {
  Made m;
  const Watch watch(Watch::Kind::wall);
  MAPCODEC_TRY(compress_files(s.files, path, o));
  m.seconds = watch.seconds();
  MAPCODEC_TRY(look_at(path, original, m));
  return m;
}

/// @param first_at_once  the map begins as one compressed from the first scan, not as an empty one.
Result<Made> scan_after_scan(const Sequence& s, const CompressOptions& o, bool first_at_once, bool cap,
                             const PointCloud& original, const std::string& path,
                             std::vector<double>& seconds) {
  Arena arena(0);
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  for (std::size_t i = 0; i < s.files.size(); ++i) {
    const Watch watch(Watch::Kind::wall);
    if (i == 0 && first_at_once) {
      MAPCODEC_TRY(compress_files({s.files[0]}, path, o));
    } else {
      UpdateRequest r;
      r.inputs = {s.files[i]};
      r.unit_m = s.unit_m;
      r.create = o;
      r.settings.density_cap = cap;
      std::vector<std::string> warnings;
      MAPCODEC_TRY(update_files(path, r, arena, warnings));
    }
    if (i > 0) seconds.push_back(watch.seconds());
  }
  Made m;
  const Watch watch(Watch::Kind::wall);
  {
    MAPCODEC_ASSIGN(MapUpdater map, MapUpdater::open(path, arena));
    MAPCODEC_TRY(map.fold());
    MAPCODEC_TRY(map.commit(0));
  }
  MAPCODEC_TRY(compact_archive(path));
  m.seconds = watch.seconds();
  MAPCODEC_TRY(look_at(path, original, m));
  return m;
}

Status measure_sequence(const Sequence& s, PromiseKind kind, double value, Report& report,
                        const BenchSettings& settings) {
  settings.say(fmt::format("{}, {} {}", s.name, promise_name(kind), value));
  const CompressOptions o = options_of(kind, value, s);
  MAPCODEC_ASSIGN(const PointCloud original, load_all(s));
  MAPCODEC_ASSIGN(const Made whole, at_once(s, o, original, report.scratch()));
  struct Way {
    const char* name;
    bool first_at_once, cap;
  };
  for (const Way way : {Way{"begun empty", false, true}, Way{"first scan compressed", true, true},
                        Way{"begun empty, all points", false, false}}) {
    std::vector<double> seconds;
    MAPCODEC_ASSIGN(const Made m,
                    scan_after_scan(s, o, way.first_at_once, way.cap, original, report.scratch(), seconds));
    report.row({s.name, fmt::format("{} {}", promise_name(kind), value), way.name,
                digits(double(m.bytes) / double(whole.bytes)),
                digits(double(m.points) / double(whole.points)), digits(1e3 * m.quality.rms_m),
                digits(1e3 * whole.quality.rms_m), digits(1e3 * bench::quantile(seconds, 0.5)),
                digits(m.seconds)});
    report.json()["sequences"].push_back(Json{{"name", s.name},
                                              {"promise", promise_name(kind)},
                                              {"value", value},
                                              {"way", way.name},
                                              {"bytes", m.bytes},
                                              {"bytes_at_once", whole.bytes},
                                              {"points", m.points},
                                              {"points_at_once", whole.points},
                                              {"rms_m", m.quality.rms_m},
                                              {"rms_at_once_m", whole.quality.rms_m},
                                              {"seconds_per_scan", bench::quantile(seconds, 0.5)},
                                              {"compact_seconds", m.seconds}});
  }
  return {};
}

}  // namespace

Status bench_update(const BenchSettings& settings) {
  Report report(settings, "update", settings.threads);
  MAPCODEC_TRY(report.begin());
  const std::string scratch = settings.report + "/scans";
  report.line("## Scan after scan, compacted, beside the map made at once\n");
  report.table(
      {"scans", "promise", "map", "size x", "points x", "RMS mm", "at once mm", "ms a scan", "compact s"});
  for (const Sequence& s : find_sequences(settings, scratch)) {
    for (const double rms : {0.01, 0.03})
      MAPCODEC_TRY(measure_sequence(s, PromiseKind::rms, rms, report, settings));
    MAPCODEC_TRY(measure_sequence(s, PromiseKind::max_error, 0.01, report, settings));
  }
  std::error_code ignored;
  std::filesystem::remove_all(scratch, ignored);
  if (is_wanted(settings, "growth")) MAPCODEC_TRY(bench::measure_growth(settings, report));
  if (is_wanted(settings, "ingest")) MAPCODEC_TRY(bench::measure_ingest(settings, report));
  std::filesystem::remove(report.scratch(), ignored);
  return report.finish();
}

}  // namespace mapcodec
