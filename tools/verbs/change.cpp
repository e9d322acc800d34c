// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/verbs/change.hpp"

#include <spdlog/fmt/fmt.h>
#include <spdlog/spdlog.h>

#include "tools/verbs/history.hpp"

namespace mapcodec::cli {
namespace {

Json change_json(const UpdateReport& r, const std::vector<std::string>& warnings, double seconds) {
  Json j;
  j["revision"] = r.revision;
  j["committed"] = r.committed;
  j["points_in"] = r.points_in;
  j["points_added"] = r.points_added;
  j["points_known"] = r.points_known;
  j["dropped_points"] = r.dropped_points;
  j["tiles_touched"] = r.tiles_touched;
  j["tiles_new"] = r.tiles_new;
  j["tiles_removed"] = r.tiles_removed;
  j["tiles_folded"] = r.tiles_folded;
  j["tiles_split"] = r.tiles_split;
  j["segment_bytes"] = r.bytes;
  j["seconds"] = seconds;
  j["points_per_second"] = seconds > 0 ? double(r.points_in) / seconds : 0;
  j["peak_memory_bytes"] = peak_memory_bytes();
  j["warnings"] = warnings;
  return j;
}

std::string change_text(const UpdateReport& r) {
  if (!r.committed) return fmt::format("nothing new; still revision {}", r.revision);
  std::string s = fmt::format("revision {}", r.revision);
  if (r.points_in > 0)
    s += fmt::format(", {} of {} points added", human_count(r.points_added), human_count(r.points_in));
  if (r.tiles_touched > 0)
    s += fmt::format(", {} tiles touched ({} new)", human_count(r.tiles_touched), human_count(r.tiles_new));
  if (r.tiles_removed > 0) s += fmt::format(", {} tiles removed", human_count(r.tiles_removed));
  return s;
}

}  // namespace

Result<PoseChange> parse_pose(const std::string& text) {
  MAPCODEC_ASSIGN(const std::vector<double> v, parse_numbers(text, 7));
  const double length = std::sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  if (!(std::abs(length - 1) < 1e-3))
    return make_error(ErrorCode::kInvalidArgument,
                      fmt::format("the quaternion of a pose has length 1, this one {:.6g}", length));
  PoseChange p;
  p.translation_m = {v[0], v[1], v[2]};
  for (std::size_t i = 0; i < 4; ++i) p.rotation_xyzw[i] = v[3 + i] / length;
  MAPCODEC_TRY(check_pose(p.translation_m, p.rotation_xyzw));
  return p;
}

void print_change(const std::string& map, const UpdateReport& report,
                  const std::vector<std::string>& warnings, double seconds, bool json) {
  for (const std::string& warning : warnings) spdlog::warn("note: {}", warning);
  if (json) {
    fmt::print("{}\n", json_text(change_json(report, warnings, seconds)));
  } else {
    fmt::print("{}: {}, {:.2f} s\n", map, change_text(report), seconds);
  }
}

}  // namespace mapcodec::cli
