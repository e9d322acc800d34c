// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/pose_track.hpp"

#include <algorithm>

#include "maps/submap_pose.hpp"
#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/formats/text_number.hpp"
#include "slam_adapter/mrpt/pose_math.hpp"

namespace mapcodec {
namespace {

using Row = std::vector<double>;
constexpr std::uint64_t kLargestFile = std::uint64_t{1} << 30;

Quaternion of_yaw_pitch_roll(double yaw, double pitch, double roll) {
  const Quaternion z{0, 0, std::sin(yaw / 2), std::cos(yaw / 2)};
  const Quaternion y{0, std::sin(pitch / 2), 0, std::cos(pitch / 2)};
  const Quaternion x{std::sin(roll / 2), 0, 0, std::cos(roll / 2)};
  return product(product(z, y), x);
}

/// Of the rotation in the left three columns of a 3 x 4 matrix (Shepperd 1978: the largest first).
std::optional<Quaternion> of_matrix(const Row& m) {
  const auto r = [&](std::size_t row, std::size_t column) { return m[4 * row + column]; };
  const double squares[4] = {1 + r(0, 0) - r(1, 1) - r(2, 2), 1 - r(0, 0) + r(1, 1) - r(2, 2),
                             1 - r(0, 0) - r(1, 1) + r(2, 2), 1 + r(0, 0) + r(1, 1) + r(2, 2)};
  const auto most = std::size_t(std::max_element(squares, squares + 4) - squares);
  if (!(squares[most] > 0.5)) return std::nullopt;
  const double s = 2 * std::sqrt(squares[most]);
  Quaternion q;
  if (most == 3) {
    q = {(r(2, 1) - r(1, 2)) / s, (r(0, 2) - r(2, 0)) / s, (r(1, 0) - r(0, 1)) / s, s / 4};
  } else {
    const std::size_t i = most, j = (i + 1) % 3, k = (i + 2) % 3;
    q[i] = s / 4;
    q[j] = (r(j, i) + r(i, j)) / s;
    q[k] = (r(k, i) + r(i, k)) / s;
    q[3] = (r(k, j) - r(j, k)) / s;
  }
  for (std::size_t row = 0; row < 3; ++row) {  // columns of length 1 make a rotation
    double length = 0;
    for (std::size_t c = 0; c < 3; ++c) length += r(row, c) * r(row, c);
    if (std::abs(length - 1) > 1e-2) return std::nullopt;
  }
  return normalized(q);
}

bool has_stamp(std::size_t columns) {
  return columns == 8 || columns == 7 || columns == 4;
}

std::optional<MapPose> pose_of_row(const Row& r) {
  switch (r.size()) {
    case 8: {
      const double n = r[4] * r[4] + r[5] * r[5] + r[6] * r[6] + r[7] * r[7];
      if (!(n > 0.5 && n < 2)) return std::nullopt;
      return MapPose{{r[1], r[2], r[3]}, normalized({r[4], r[5], r[6], r[7]})};
    }
    case 7:
      return MapPose{{r[1], r[2], r[3]}, of_yaw_pitch_roll(r[4], r[5], r[6])};
    case 6:
      return MapPose{{r[0], r[1], r[2]}, of_yaw_pitch_roll(r[3], r[4], r[5])};
    case 4:
      return MapPose{{r[1], r[2], 0}, of_yaw_pitch_roll(r[3], 0, 0)};
    case 3:
      return MapPose{{r[0], r[1], 0}, of_yaw_pitch_roll(r[2], 0, 0)};
    case 12:
      if (const auto q = of_matrix(r)) return MapPose{{r[3], r[7], r[11]}, *q};
      break;
    default:
      break;
  }
  return std::nullopt;
}

/// Numbers of a line; nothing if a word is none.
std::optional<Row> numbers(std::string_view line) {
  Row row;
  Words words(line, true);
  for (std::string_view word; words.next(word);) {
    double v = 0;
    const auto [end, bad] = std::from_chars(word.data(), word.data() + word.size(), v);
    if (bad != std::errc{} || end != word.data() + word.size() || !std::isfinite(v)) return std::nullopt;
    row.push_back(v);
  }
  return row;
}

Result<std::vector<Row>> rows_of(std::string_view text, const std::string& name) {
  std::vector<Row> rows;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(text.size(), end + 1));
    line = line.substr(0, line.find_first_of("#%\r"));
    const auto row = numbers(line);
    const std::string where = "line " + std::to_string(line_number);
    if (!row)
      return named(name, make_error(ErrorCode::kMalformed, where + " holds a word that is no number"));
    if (row->empty()) continue;
    if (!rows.empty() && row->size() != rows[0].size())
      return named(name, make_error(ErrorCode::kMalformed, where + " has " + std::to_string(row->size()) +
                                                               " columns, the others " +
                                                               std::to_string(rows[0].size())));
    if (!pose_of_row(*row))
      return named(name, make_error(ErrorCode::kMalformed,
                                    where + " is no pose: TUM has 8 columns, KITTI 12, MRPT 7 (flat: 4)"));
    rows.push_back(*row);
  }
  if (rows.empty()) return named(name, make_error(ErrorCode::kEmpty, "holds no pose"));
  return rows;
}

/// Some programs number their steps instead of timing them.
bool counts_steps(const std::vector<Row>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i][0] != double(i)) return false;
  }
  return true;
}

}  // namespace

void PoseTrack::add(double stamp_s, const MapPose& pose) {
  if (!stamps_.empty() && stamp_s == stamps_.back()) {
    poses_.back() = pose;
    return;
  }
  stamps_.push_back(stamp_s);
  poses_.push_back(pose);
}

void PoseTrack::add(const MapPose& pose) {
  poses_.push_back(pose);
}

std::optional<MapPose> PoseTrack::at(double stamp_s, double gap_s, double near_s) const {
  const auto after = std::lower_bound(stamps_.begin(), stamps_.end(), stamp_s);
  const auto i = std::size_t(after - stamps_.begin());
  if (i < stamps_.size() && stamps_[i] == stamp_s) return poses_[i];
  if (i > 0 && i < stamps_.size() && stamps_[i] - stamps_[i - 1] <= gap_s) {
    return interpolated(poses_[i - 1], poses_[i], (stamp_s - stamps_[i - 1]) / (stamps_[i] - stamps_[i - 1]));
  }
  if (i < stamps_.size() && stamps_[i] - stamp_s <= near_s) return poses_[i];
  if (i > 0 && stamp_s - stamps_[i - 1] <= near_s) return poses_[i - 1];
  return std::nullopt;
}

std::optional<MapPose> PoseTrack::at_place(std::size_t place) const {
  return place < poses_.size() ? std::optional(poses_[place]) : std::nullopt;
}

Result<PoseTrack> read_pose_text(std::string_view text, const std::string& name) {
  MAPCODEC_ASSIGN(std::vector<Row> rows, rows_of(text, name));
  PoseTrack track;
  if (!has_stamp(rows[0].size()) || counts_steps(rows)) {
    for (const Row& r : rows) track.add(*pose_of_row(r));
    return track;
  }
  std::stable_sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a[0] < b[0]; });
  for (const Row& r : rows) track.add(r[0], *pose_of_row(r));
  return track;
}

Result<PoseTrack> read_pose_file(const std::string& path) {
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  if ((*stream)->size() > kLargestFile)
    return named(path, make_error(ErrorCode::kLimitExceeded, "is no file of poses: more than a gigabyte"));
  std::string text((*stream)->size(), '\0');
  auto got = (*stream)->read_at(0, reinterpret_cast<std::uint8_t*>(text.data()), text.size());
  if (!got.ok()) return named(path, got.error());
  text.resize(*got);
  return read_pose_text(text, path);
}

}  // namespace mapcodec
