// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/scan_folder.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "slam_adapter/formats/ascii_rows.hpp"

namespace mapcodec {
namespace {

bool is_scan_name(const std::string& name) {
  const bool ends = name.starts_with("scan") && name.ends_with(".3d") && name.size() > 7;
  return ends && std::all_of(name.begin() + 4, name.end() - 3, [](char c) { return c >= '0' && c <= '9'; });
}

/// Paths of the scans, by name.
std::vector<std::string> scans_of(const std::string& folder) {
  std::vector<std::string> r;
  std::error_code error;
  for (std::filesystem::directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
    if (is_scan_name(i->path().filename().string())) r.push_back(i->path().string());
  }
  std::sort(r.begin(), r.end());
  return r;
}

Result<std::unique_ptr<PointSource>> open_scan(const std::string& path, const ReadOptions& options) {
  const std::string pose_path = path.substr(0, path.size() - 2) + "pose";
  auto pose_stream = file_stream(pose_path);
  if (!pose_stream.ok()) return named(pose_path, pose_stream.error());
  auto pose = read_scan_pose(**pose_stream);
  if (!pose.ok()) return named(pose_path, pose.error());
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  auto reader = open_text(**stream, TextShape::plain, *pose);
  if (!reader.ok()) return named(path, reader.error());
  return make_source(std::move(stream).value(), std::move(reader).value(), path, options);
}

}  // namespace

bool is_scan_folder(const std::string& folder) {
  return !scans_of(folder).empty();
}

Result<TextTransform> read_scan_pose(const ByteStream& stream) {
  Cursor cursor(stream);
  double v[6];
  std::size_t n = 0;
  std::string_view line, word;
  while (n < 6 && cursor.content_line(line, true)) {
    for (Words words(line); n < 6 && words.next(word); ++n) {
      if (!parse_number(word, v[n]) || !std::isfinite(v[n]))
        return line_error(cursor, quoted(word) + " is no number");
    }
  }
  if (n < 6)
    return make_error(ErrorCode::kTruncated, "holds " + std::to_string(n) + " of the six numbers of a pose");
  const double rad = std::numbers::pi / 180;
  const double sx = std::sin(v[3] * rad), cx = std::cos(v[3] * rad), sy = std::sin(v[4] * rad),
               cy = std::cos(v[4] * rad);
  const double sz = std::sin(v[5] * rad), cz = std::cos(v[5] * rad);
  TextTransform t;
  t.rows = {Vec3{cy * cz, -cy * sz, sy}, Vec3{sx * sy * cz + cx * sz, cx * cz - sx * sy * sz, -sx * cy},
            Vec3{sx * sz - cx * sy * cz, cx * sy * sz + sx * cz, cx * cy}};
  t.translation = {v[0], v[1], v[2]};
  return t;
}

Result<std::unique_ptr<PointSource>> open_scan_folder(const std::string& folder, const ReadOptions& options) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const std::string& path : scans_of(folder)) {
    MAPCODEC_ASSIGN(auto source, open_scan(path, options));
    sources.push_back(std::move(source));
  }
  return concatenate(std::move(sources));
}

Result<std::uint64_t> scan_folder_bytes(const std::string& folder) {
  std::uint64_t sum = 0;
  for (const std::string& path : scans_of(folder)) {
    auto stream = file_stream(path);
    if (!stream.ok()) return named(path, stream.error());
    sum += (*stream)->size();
  }
  return sum;
}

}  // namespace mapcodec
