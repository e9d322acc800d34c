// SPDX-License-Identifier: GPL-3.0-or-later
// Files of the formats whose readers are larger than their writers, there and back: read, compressed without
// loss, written to a plain file, read again.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "mapcodec/quality/multiset_hash.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/decompress.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;
using bench::Json;

const std::set<std::string> kFormats{"LAZ", "E57", "ROS bag", "Autoware"};

/// Everything that a reader gives.
struct Content {
  std::uint64_t points = 0, dropped = 0;
  Box bounds;
  MultisetHash hash;
  bool comparable = true;  ///< has all that it is compared with
  PointCloud layout;
  std::vector<std::string> warnings;
};

/// The channels of `like` alone; false if there are not all of them.
bool project(PointCloud& block, const PointCloud& like) {
  if (block.coordinates != like.coordinates) return false;
  std::vector<Channel> channels;
  for (const Channel& wanted : like.channels) {
    const Channel* c = block.find(wanted.info.name);
    if (c == nullptr || c->info != wanted.info) return false;
    channels.push_back(*c);
  }
  block.channels = std::move(channels);
  return true;
}

/// @param like  if given: what the format of the file adds of its own is left out of the hash.
Result<Content> read_all(const std::string& path, const PointCloud* like = nullptr) {
  ReadOptions options;
  options.keep_nonfinite = true;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_source(path, options));
  Content c;
  c.layout = source->layout().like();
  for (PointCloud block;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    c.points += block.size();
    c.bounds.add(block.bounds());
    c.comparable = like == nullptr || project(block, *like);
    c.hash.add(block);
  }
  c.dropped = source->dropped_points();
  c.warnings = source->warnings();
  return c;
}

Result<Content> read_map(const std::string& path) {
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  Content c;
  MAPCODEC_TRY(map.read(Region{}, {}, [&](PointCloud&& cloud) {
    c.points += cloud.size();
    c.bounds.add(cloud.bounds());
    c.hash.add(cloud);
    return Status{};
  }));
  return c;
}

/// Whether the bounds are those of the header of LAS, within half a unit; "-" for other formats.
std::string header_bounds(const std::string& path, const std::string& format, const Content& c) {
  if (format != "LAZ") return "-";
  char head[227] = {};
  std::ifstream(path, std::ios::binary).read(head, sizeof(head));
  bool same = true;
  for (std::size_t d = 0; d < 3; ++d) {
    double scale = 0, max = 0, min = 0;
    std::memcpy(&scale, head + 131 + 8 * d, 8);
    std::memcpy(&max, head + 179 + 16 * d, 8);
    std::memcpy(&min, head + 187 + 16 * d, 8);
    // Some writers leave the bounds as they were before they rounded to units.
    same = same && std::fabs(c.bounds.max[d] - max) <= 0.51 * scale &&
           std::fabs(c.bounds.min[d] - min) <= 0.51 * scale;
  }
  return same ? "yes" : "NO";
}

std::string text(const Box& b) {
  if (b.empty()) return "-";
  return fmt::format("{:.3f} {:.3f} {:.3f} .. {:.3f} {:.3f} {:.3f}", b.min[0], b.min[1], b.min[2], b.max[0],
                     b.max[1], b.max[2]);
}

struct Row {
  std::string format, header, archive, file;
  Content original;
  std::uint64_t input_bytes = 0, archive_bytes = 0;
};

Result<Row> there_and_back(const std::string& path, const std::string& format, const std::string& scratch) {
  Row r;
  r.format = format;
  MAPCODEC_ASSIGN(r.original, read_all(path));
  MAPCODEC_ASSIGN(r.input_bytes, input_bytes(path));
  r.header = header_bounds(path, format, r.original);
  CompressOptions options;
  options.promise = PromiseKind::lossless;
  options.promise_m = 0;
  options.overwrite = true;
  MAPCODEC_ASSIGN(const CompressReport report, compress_files({path}, scratch, options));
  MAPCODEC_ASSIGN(const Content map, read_map(scratch));
  r.archive = map.hash == r.original.hash && report.points == r.original.points ? "every bit" : "DIFFERS";
  r.archive_bytes = fs::file_size(scratch);
  const bool fixed = r.original.layout.coordinates.kind == CoordinateFormat::Kind::fixed;
  const std::string back = scratch + (fixed ? ".las" : ".pcd");
  MAPCODEC_ASSIGN(const DecompressReport written, decompress(scratch, back, {}, std::nullopt, {}));
  MAPCODEC_ASSIGN(const Content again, read_all(back, &r.original.layout));
  const bool counts = written.points == r.original.points && again.points == r.original.points;
  const bool bounds = again.bounds.min == r.original.bounds.min && again.bounds.max == r.original.bounds.max;
  r.file = !counts || !bounds              ? "DIFFERS"
           : !again.comparable             ? "count, bounds"
           : again.hash == r.original.hash ? "every bit"
                                           : "DIFFERS";
  std::error_code ignored;
  fs::remove(back, ignored);
  fs::remove(scratch, ignored);
  return r;
}

Result<std::vector<std::pair<std::string, std::string>>> find_files(const BenchSettings& settings) {
  std::error_code failed;
  fs::recursive_directory_iterator it(settings.data, failed);
  if (failed) return make_error(ErrorCode::kNotFound, settings.data + ": " + failed.message());
  std::vector<std::pair<std::string, std::string>> files;
  for (const fs::directory_entry& entry : it) {
    const std::string path = entry.path().string();
    const bool wanted = settings.files.empty() || std::any_of(settings.files.begin(), settings.files.end(),
                                                              [&](const std::string& part) {
                                                                return path.find(part) != std::string::npos;
                                                              });
    const Result<std::string> format = detect_format(path);
    if (wanted && format.ok() && kFormats.count(*format) > 0) files.emplace_back(path, *format);
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

Status bench_formats(const BenchSettings& settings) {
  bench::Report report(settings, "formats", 1);
  MAPCODEC_TRY(report.begin());
  MAPCODEC_ASSIGN(const auto files, find_files(settings));
  report.table({"file", "format", "points", "left out", "bounds", "as the header", "archive, lossless",
                "to the file", "archive against reader", "written and read again"});
  report.json()["files"] = Json::array();
  for (const auto& [path, format] : files) {
    const std::string name = fs::path(path).filename().string();
    settings.say(name);
    const Result<Row> r = there_and_back(path, format, report.scratch());
    if (!r.ok()) {
      report.row({name, format, "-", "-", "-", "-", "-", "-", "-",
                  r.error().to_string().substr(r.error().message.find(": ") + 2)});
      report.json()["files"].push_back(
          {{"file", name}, {"format", format}, {"error", r.error().to_string()}});
      settings.print(r.error().to_string());
      continue;
    }
    const double ratio = static_cast<double>(r->archive_bytes) / static_cast<double>(r->input_bytes);
    report.row({name, format, std::to_string(r->original.points), std::to_string(r->original.dropped),
                text(r->original.bounds), r->header, std::to_string(r->archive_bytes), bench::digits(ratio),
                r->archive, r->file});
    report.json()["files"].push_back({{"file", name},
                                      {"format", format},
                                      {"points", r->original.points},
                                      {"left_out", r->original.dropped},
                                      {"header_bounds", r->header},
                                      {"input_bytes", r->input_bytes},
                                      {"archive_bytes", r->archive_bytes},
                                      {"archive", r->archive},
                                      {"written", r->file}});
    settings.print(fmt::format("{}: {} points, archive {} ({} of the file), {}; written: {}", name,
                               r->original.points, r->archive_bytes, bench::digits(ratio), r->archive,
                               r->file));
    for (const std::string& w : r->original.warnings) report.note(w);
  }
  return report.finish();
}

}  // namespace mapcodec
