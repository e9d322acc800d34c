// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/log_source.hpp"

#include <algorithm>

#include "maps/submap_pose.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/mrpt/log_poses.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kBlock = 65536;

class LogSource final : public PointSource {
 public:
  LogSource(std::string path, LogSurvey survey, const ReadOptions& options)
      : path_(std::move(path)), survey_(std::move(survey)), options_(options) {
    layout_ = survey_.layout;
    const auto kind =
        survey_.moves || options.unit_m != 1 ? CoordinateFormat::Kind::f64 : CoordinateFormat::Kind::f32;
    layout_.coordinates = {kind, {1, 1, 1}, {0, 0, 0}};
  }

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return std::nullopt; }
  [[nodiscard]] std::uint64_t dropped_points() const override { return dropped_; }

  Result<bool> next(PointCloud& block) override {
    block = layout_.like();
    if (!failed_.ok()) return failed_.error();
    if (const Status s = fill(); !s.ok()) {
      failed_ = s;
      return s.error();
    }
    const std::size_t end = std::min(frame_.size(), at_ + kBlock);
    block.append(frame_, at_, end);
    at_ = end;
    points_ += block.size();
    if (points_ > 0 || dropped_ > 0) return !block.empty();
    std::string why;
    for (const std::string& s : unused_classes(reader_->summary())) why += (why.empty() ? ": " : ", ") + s;
    failed_ = named(path_, make_error(ErrorCode::kEmpty, "none of its observations gives a point" + why));
    return failed_.error();
  }

  Status rewind() override {
    reader_.reset();
    frame_ = layout_.like();
    at_ = 0;
    points_ = dropped_ = without_pose_ = 0;
    failed_ = {};
    ended_ = false;
    return {};
  }

  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> said = survey_.jumps;
    for (const std::string& s : unused_classes(survey_.summary)) said.push_back(s);
    for (const std::string& s : survey_.missing)
      said.push_back("some observations have no " + s + ": it is zero there");
    if (LogPoses::best_of(survey_).source() == PoseSource::none && survey_.frames > 1)
      said.push_back("the log has no poses: all observations lie as if the vehicle had not moved");
    if (without_pose_ > 0)
      said.push_back(std::to_string(without_pose_) +
                     " observations come before the first pose: they are left out");
    return said;
  }

 private:
  /// Reads on until there are points left of a frame, or the end.
  Status fill() {
    while (at_ == frame_.size() && !ended_) {
      if (!reader_) {
        MAPCODEC_ASSIGN(RawlogReader r, RawlogReader::open(path_));
        reader_.emplace(std::move(r));
        poses_ = LogPoses::best_of(survey_);
      }
      MAPCODEC_ASSIGN(auto frame, reader_->next());
      ended_ = !frame;
      if (frame) take(std::move(*frame));
    }
    return {};
  }

  void take(RawlogFrame&& f) {
    frame_ = layout_.like();
    at_ = 0;
    const auto pose = poses_.of(f);
    if (!pose) {
      ++without_pose_;
      return;
    }
    PointCloud points = with_layout(std::move(f.points), layout_);
    points.coordinates = layout_.coordinates;
    const RigidMotion motion(pose->translation_m, pose->rotation_xyzw);
    std::vector<std::uint32_t> finite;
    for (std::size_t i = 0; i < points.size(); ++i) {
      points.xyz[i] = motion.apply(points.xyz[i]);
      for (double& v : points.xyz[i]) v *= options_.unit_m;
      if (is_finite(points.xyz[i])) finite.push_back(static_cast<std::uint32_t>(i));
    }
    if (finite.size() < points.size() && !options_.keep_nonfinite) {
      dropped_ += points.size() - finite.size();
      points = points.gather(finite);
    }
    frame_ = std::move(points);
  }

  std::string path_;
  LogSurvey survey_;
  ReadOptions options_;
  PointCloud layout_, frame_;
  std::size_t at_ = 0;
  std::optional<RawlogReader> reader_;
  LogPoses poses_ = LogPoses::best_of({});
  std::uint64_t points_ = 0, dropped_ = 0, without_pose_ = 0;
  Status failed_;
  bool ended_ = false;
};

}  // namespace

Result<std::unique_ptr<PointSource>> open_log(const std::string& path, const ReadOptions& options) {
  MAPCODEC_ASSIGN(LogSurvey survey, survey_log(path, {}));
  if (survey.damage) return *survey.damage;
  auto source = std::make_unique<LogSource>(path, std::move(survey), options);
  MAPCODEC_TRY(source->rewind());
  return std::unique_ptr<PointSource>(std::move(source));
}

}  // namespace mapcodec
