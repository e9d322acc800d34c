// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/verbs/report.hpp"

#include "slam_adapter/map_updater.hpp"

#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <unistd.h>

#include <charconv>
#include <csignal>
#include <cstdio>
#include <filesystem>

#include "maps/store_schemes.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/formats/formats.hpp"

namespace mapcodec::cli {
namespace {

std::atomic<bool> stop_requested{false};

void request_stop(int signal) {
  stop_requested.store(true);
  // A second signal ends the program at once, as people expect.
  std::signal(signal, SIG_DFL);
}

/// JSON has no NaN or infinity: such a figure does not apply and is null.
Json number(double v) {
  return std::isfinite(v) ? Json(v) : Json(nullptr);
}

Json vec_json(const Vec3& v) {
  return Json::array({number(v[0]), number(v[1]), number(v[2])});
}

Json errors_json(const TileErrors& e) {
  return {{"rms_m", e.rms_m},
          {"max_axis_error_m", e.max_axis_error_m},
          {"color_error", e.color_error},
          {"density_error", e.density_error}};
}

Json channels_json(const MapSchema& schema) {
  Json list = Json::array();
  for (const ChannelSchema& c : schema.channels) {
    Json entry{{"name", c.info.name}, {"type", c.info.type_name()}, {"kept", kept_name(c.kept)}};
    if (c.kept == ChannelKept::bounded) entry["bound"] = c.bound;
    list.push_back(std::move(entry));
  }
  return list;
}

Json codecs_json(const MapSummary& s) {
  Json r = Json::object();
  for (const auto& [name, t] : s.codecs)
    r[name] = {{"tiles", t.tiles}, {"points", t.points}, {"bytes", t.bytes}};
  return r;
}

/// Only where the map says it.
Json levels_json(const MapSchema& schema, const LevelErrors& e) {
  Json list = Json::array();
  for (std::size_t l = 0; l < e.levels.size(); ++l) {
    list.push_back({{"level", l},
                    {"cell_m", std::ldexp(schema.tile_size_m, -static_cast<int>(l))},
                    {"rms_m", e.levels[l].rms_m},
                    {"byte_share", e.levels[l].byte_share}});
  }
  return list;
}

std::string level_text(const MapSchema& schema, const LevelErrors& e, std::size_t l) {
  return fmt::format("{}: cells of {}, RMS {}, {:.0f} % of the bytes", l,
                     human_length(std::ldexp(schema.tile_size_m, -static_cast<int>(l))),
                     human_length(e.levels[l].rms_m), 100 * e.levels[l].byte_share);
}

std::string promise_text(const MapSchema& s) {
  switch (s.promise) {
    case PromiseKind::lossless:
      return "every bit";
    case PromiseKind::max_error:
      return "no point moves more than " + human_length(s.promise_value) + " along an axis";
    case PromiseKind::rms:
      return "symmetric RMS at most " + human_length(s.promise_value);
    case PromiseKind::paper:
      return "none (the 2014 method)";
  }
  return "?";
}

void row(const char* name, const std::string& value) {
  fmt::print("{:<12} {}\n", name, value);
}

std::string duration_text(double seconds) {
  return seconds < 100 ? fmt::format("{:.0f} s", seconds) : fmt::format("{:.0f} min", seconds / 60);
}

/// Remembers when each phase began, to tell rate and remaining time.
class ProgressBar {
 public:
  void draw(const Progress& p) {
    using Clock = std::chrono::steady_clock;
    const auto now = Clock::now();
    if (p.phase != phase_) {
      if (!phase_.empty()) std::fputc('\n', stderr);
      phase_ = p.phase;
      begin_ = now;
    } else if (now - last_ < std::chrono::milliseconds(100) && p.done < p.total) {
      return;
    }
    last_ = now;
    const double seconds = std::chrono::duration<double>(now - begin_).count();
    const double share = p.total == 0 ? 0 : std::min(1.0, double(p.done) / double(p.total));
    const double rate = seconds > 0 ? double(p.done) / seconds : 0;
    const std::string left =
        share > 0 && share < 1 ? duration_text(seconds * (1 - share) / share) + " left" : "";
    const int filled = int(share * 24);
    fmt::print(stderr, "\r{:<9} [{}{}] {:3.0f} %  {}  {:<12}", phase_, std::string(size_t(filled), '#'),
               std::string(size_t(24 - filled), '.'), 100 * share, rate_text(rate), left);
    std::fflush(stderr);
  }
  ~ProgressBar() {
    if (!phase_.empty()) std::fputc('\n', stderr);
  }

 private:
  /// Decoding counts tiles, everything else points.
  [[nodiscard]] std::string rate_text(double rate) const {
    return phase_ == "decode" ? fmt::format("{:6.0f} tiles/s", rate)
                              : fmt::format("{:6.2f} M points/s", rate / 1e6);
  }

  std::string phase_;
  std::chrono::steady_clock::time_point begin_, last_;
};

/// One line at each tenth of a phase, for logs.
class PlainProgress {
 public:
  void draw(const Progress& p) {
    const std::uint64_t tenth = p.total == 0 ? 0 : 10 * p.done / p.total;
    if (p.phase == phase_ && tenth == tenth_) return;
    phase_ = p.phase;
    tenth_ = tenth;
    fmt::print(stderr, "{}: {} of {} {}\n", p.phase, human_count(p.done), human_count(p.total),
               phase_ == "decode" ? "tiles" : "points");
  }

 private:
  std::string phase_;
  std::uint64_t tenth_ = 0;
};

void print_json_progress(const Progress& p) {
  const Json line{{"phase", p.phase}, {"done", p.done}, {"total", p.total}, {"bytes_out", p.bytes_out}};
  fmt::print(stderr, "{}\n", line.dump());
}

}  // namespace

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return kUsage;
    case ErrorCode::kCannotWrite:
      return kNoOutput;
    case ErrorCode::kArchiveDamaged:
    case ErrorCode::kChecksumMismatch:
    case ErrorCode::kUnknownCodec:
      return kDamaged;
    case ErrorCode::kPromiseBroken:
      return kDifference;
    case ErrorCode::kCancelled:
      return kInterrupted;
    case ErrorCode::kUnreachable:
    case ErrorCode::kBusy:
      return kUnreachable;
    default:
      return kBadInput;
  }
}

int fail(const std::string& file, const Error& error) {
  std::string text = error.to_string();
  for (char& c : text) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  const bool named = file.empty() || text.find(file) != std::string::npos;
  fmt::print(stderr, "mapcodec: {}{}{}\n", named ? "" : file, named ? "" : ": ", text);
  return exit_code(error.code);
}

const std::atomic<bool>* stop_flag() {
  static const bool installed = [] {
    std::signal(SIGINT, request_stop);
    std::signal(SIGTERM, request_stop);
    // A file size limit should be an error of write(), not a death.
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGPIPE, SIG_IGN);
    return true;
  }();
  (void)installed;
  return &stop_requested;
}

ProgressCallback progress_printer(const std::string& style) {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  if (style == "json") return print_json_progress;
  if (style == "plain") return [p = std::make_shared<PlainProgress>()](const Progress& v) { p->draw(v); };
  if (style == "bar" || (style == "auto" && terminal)) {
    return [p = std::make_shared<ProgressBar>()](const Progress& v) { p->draw(v); };
  }
  return {};
}

Json info_json(const MapFile& map) {
  const MapSummary s = map.summary();
  const MapSchema& schema = map.schema();
  Json j;
  j["format_version"] = kArchiveFormatVersion;
  j["points"] = s.points;
  j["tiles"] = s.tiles;
  j["bytes"] = s.bytes;
  j["bits_per_point"] = s.bits_per_point;
  j["ratio"] = s.ratio;
  j["input_bytes"] = s.input_bytes;
  j["promise"] = {{"kind", promise_name(schema.promise)}, {"value", schema.promise_value}};
  j["achieved"] = errors_json(s.achieved);
  j["bounds"] = {{"min", vec_json(s.bounds.min)}, {"max", vec_json(s.bounds.max)}};
  j["tile_size_m"] = schema.tile_size_m;
  j["channels"] = channels_json(schema);
  j["codecs"] = codecs_json(s);
  j["revision"] = map.archive().revision();
  j["submaps"] = std::max<std::size_t>(1, map.archive().info().submaps.size());
  j["input_points"] = map.archive().info().input_points;
  j["density_cap"] = map.archive().info().extras.count(kDensityCapExtra) != 0;
  j["levels"] = levels_json(schema, s.levels);
  j["dropped_points"] = map.archive().info().dropped_points;
  return j;
}

Json tiles_json(const MapFile& map) {
  Json list = Json::array();
  for (const TileRecord& t : map.archive().tiles()) {
    std::uint64_t bytes = 0;
    for (const SegmentRef& segment : t.segments) bytes += segment.length;
    list.push_back({{"key", {t.key.x, t.key.y, t.key.z}},
                    {"level", t.key.level},
                    {"codec", codec_name(static_cast<CodecId>(t.codec))},
                    {"points", t.points},
                    {"bytes", bytes},
                    {"bounds", {{"min", vec_json(t.bounds.min)}, {"max", vec_json(t.bounds.max)}}},
                    {"achieved", errors_json(t.errors)}});
  }
  return list;
}

void print_info(const MapFile& map) {
  const MapSummary s = map.summary();
  const MapSchema& schema = map.schema();
  row("file",
      fmt::format("{} ({}, revision {})", map.path(), human_bytes(s.bytes), map.archive().revision()));
  row("points", human_count(s.points) + fmt::format(" in {} tiles", s.tiles));
  if (const auto dropped = map.archive().info().dropped_points; dropped > 0) {
    row("dropped", human_count(dropped) + " points without a finite position");
  }
  row("size", fmt::format("{:.3f} bits per point, ratio {:.4f}", s.bits_per_point, s.ratio));
  row("promise", promise_text(schema));
  row("achieved", fmt::format("RMS {}, largest axis error {}", human_length(s.achieved.rms_m),
                              human_length(s.achieved.max_axis_error_m)));
  row("", fmt::format("colour error {:.2f}, density error {:.3f}", s.achieved.color_error,
                      s.achieved.density_error));
  if (map.archive().info().extras.count(kDensityCapExtra) != 0)
    row("updates", "leave out what the map has already, within its promise");
  if (const std::size_t n = map.archive().info().submaps.size(); n > 1)
    row("submaps", fmt::format("{}, each with its pose", human_count(n)));
  for (std::size_t d = 0; d < 3 && !s.bounds.empty(); ++d) {
    row(d == 0 ? "bounds" : "",
        fmt::format("{} {:.3f} .. {:.3f} m", "xyz"[d], s.bounds.min[d], s.bounds.max[d]));
  }
  for (const ChannelSchema& c : schema.channels) {
    row("channel",
        fmt::format("{} ({}): {}{}", c.info.name, c.info.type_name(), kept_name(c.kept),
                    c.kept == ChannelKept::bounded ? fmt::format(", error at most {}", c.bound) : ""));
  }
  for (const auto& [name, t] : s.codecs) {
    row("codec", fmt::format("{}: {} tiles, {} points, {}", name, t.tiles, human_count(t.points),
                             human_bytes(t.bytes)));
  }
  // Levels that take all bytes save nothing.
  const auto& levels = s.levels.levels;
  const bool worth = levels.size() > 1 && levels.front().byte_share < 1;
  for (std::size_t l = 0; worth && l < levels.size(); ++l) {
    if (levels[l].byte_share < 1 || l + 1 == levels.size())
      row(l == 0 ? "level" : "", level_text(schema, s.levels, l));
  }
  if (worth && s.levels.tiles < s.tiles)
    row("", fmt::format("(but the last, levels are measured on {} of the tiles)", s.levels.tiles));
}

Json evaluation_json(const Evaluation& e, std::uint64_t bytes, std::uint64_t raw_bytes) {
  Json j;
  j["points_original"] = e.points_original;
  j["points_decoded"] = e.points_decoded;
  j["count_ratio"] = number(e.count_ratio);
  j["rms_m"] = number(e.rms_m);
  j["rms_ab_m"] = number(e.rms_ab_m);
  j["rms_ba_m"] = number(e.rms_ba_m);
  j["rms_pool_m"] = number(e.rms_pool_m);
  j["max_m"] = number(e.max_m);
  j["max_axis_error_m"] = number(e.max_axis_error_m);
  j["d1_psnr_db"] = number(e.d1_psnr_db);
  j["d2_psnr_db"] = number(e.d2_psnr_db);
  j["color_error"] = number(e.color_error);
  j["y_psnr_db"] = number(e.y_psnr_db);
  j["density_error"] = number(e.density_error);
  j["bytes"] = bytes;
  j["bits_per_point"] = e.points_original == 0 ? 0 : 8.0 * double(bytes) / double(e.points_original);
  j["ratio"] = raw_bytes == 0 ? 0 : double(bytes) / double(raw_bytes);
  return j;
}

void print_evaluation(const Evaluation& e) {
  row("points",
      fmt::format("{} original, {} decoded", human_count(e.points_original), human_count(e.points_decoded)));
  row("RMS", fmt::format("{} (to decoded {}, back {})", human_length(e.rms_m), human_length(e.rms_ab_m),
                         human_length(e.rms_ba_m)));
  row("largest",
      fmt::format("{}, along one axis {}", human_length(e.max_m), human_length(e.max_axis_error_m)));
  row("PSNR", fmt::format("D1 {:.2f} dB, D2 {:.2f} dB", e.d1_psnr_db, e.d2_psnr_db));
  if (std::isfinite(e.color_error))
    row("colour", fmt::format("error {:.2f}, Y {:.2f} dB", e.color_error, e.y_psnr_db));
  row("density", fmt::format("error {:.4f}", e.density_error));
}

std::string human_bytes(std::uint64_t bytes) {
  if (bytes < 10000) return fmt::format("{} bytes", bytes);
  const char* const units[] = {"kB", "MB", "GB", "TB"};
  double v = double(bytes) / 1000;
  std::size_t u = 0;
  for (; v >= 1000 && u < 3; ++u) v /= 1000;
  return fmt::format("{:.2f} {}", v, units[u]);
}

std::string human_count(std::uint64_t count) {
  std::string s = std::to_string(count);
  for (std::size_t i = s.size(); i > 3; i -= 3) s.insert(i - 3, 1, ',');
  return s;
}

std::string human_length(double metres) {
  if (!std::isfinite(metres)) return "unknown";
  if (metres == 0) return "0";
  if (metres < 1e-3) return fmt::format("{:.3g} um", metres * 1e6);
  return metres < 1 ? fmt::format("{:.4g} mm", metres * 1e3) : fmt::format("{:.4g} m", metres);
}

std::uint64_t peak_memory_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return std::uint64_t(usage.ru_maxrss) * 1024;
}

Result<std::uint64_t> parse_size(const std::string& text) {
  double v = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), v);
  const std::string unit(end, text.data() + text.size());
  const std::map<std::string, double> units{
      {"", 1.0}, {"K", 1024.0}, {"M", 1048576.0}, {"G", 1073741824.0}, {"T", 1099511627776.0}};
  const auto known = units.find(unit);
  if (error != std::errc() || known == units.end() || !(v > 0) || v * known->second > 1e18) {
    return make_error(ErrorCode::kInvalidArgument, "'" + text + "' is not a size such as 512M or 2G");
  }
  return static_cast<std::uint64_t>(v * known->second);
}

Result<std::vector<double>> parse_numbers(const std::string& text, std::size_t count) {
  std::vector<double> numbers;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at < end) {
    double v = 0;
    const auto [next, error] = std::from_chars(at, end, v);
    if (error != std::errc() || !std::isfinite(v) || (next < end && *next != ',')) break;
    numbers.push_back(v);
    at = next < end ? next + 1 : next;
  }
  if (numbers.size() != count || at != end || text.back() == ',') {
    return make_error(ErrorCode::kInvalidArgument,
                      "'" + text + "' is not " + std::to_string(count) + " numbers separated by commas");
  }
  return numbers;
}

Result<Box> parse_box(const std::string& text) {
  MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(text, 6));
  for (std::size_t d = 0; d < 3; ++d) {
    if (!(v[d] <= v[d + 3]))
      return make_error(ErrorCode::kInvalidArgument, "--box has a minimum above its maximum");
  }
  return Box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

Result<Region::Sphere> parse_sphere(const std::string& text) {
  MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(text, 4));
  if (v[3] < 0) return make_error(ErrorCode::kInvalidArgument, "--sphere has a negative radius");
  return Region::Sphere{{v[0], v[1], v[2]}, v[3]};
}

bool path_exists(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

Result<LoadedCloud> load_any(const std::string& path, Arena& arena) {
  LoadedCloud r;
  std::error_code ignored;
  r.bytes = std::filesystem::file_size(path, ignored);
  if (is_map_file(path)) {
    MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
    if (has_store_scheme(path)) r.bytes = map.archive().file_bytes();
    ReadSettings settings;
    settings.arena = &arena;
    settings.stop = stop_flag();
    MAPCODEC_ASSIGN(r.cloud, map.read(Region{}, settings));
    r.cloud = restore_order(std::move(r.cloud));
    r.raw_bytes = map.summary().raw_bytes;
    return r;
  }
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_source(path));
  r.cloud = source->layout();
  PointCloud block;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    r.cloud.append(block);
  }
  if (r.cloud.empty()) return make_error(ErrorCode::kEmpty, "holds no point with a finite position");
  return r;
}

}  // namespace mapcodec::cli
