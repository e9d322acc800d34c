// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_updater.hpp"

#include <algorithm>

#include "slam_adapter/level_errors.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "slam_adapter/point_batch.hpp"
#include "slam_adapter/updater_state.hpp"

namespace mapcodec {

MapUpdater::MapUpdater(std::unique_ptr<State> state) : state_(std::move(state)) {}
MapUpdater::MapUpdater(MapUpdater&&) noexcept = default;
MapUpdater& MapUpdater::operator=(MapUpdater&&) noexcept = default;
MapUpdater::~MapUpdater() = default;

Result<MapUpdater> MapUpdater::open(const std::string& path, Arena& arena, const UpdateSettings& settings) {
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(path));
  return over(std::move(writer), arena, settings);
}

Result<MapUpdater> MapUpdater::over(MapWriter writer, Arena& arena, const UpdateSettings& settings,
                                    bool changed) {
  auto state = std::make_unique<State>(std::move(writer), arena, settings);
  state->changed = changed;
  MAPCODEC_TRY(state->begin());
  return MapUpdater(std::move(state));
}

const MapSchema& MapUpdater::schema() const {
  return state_->schema;
}
const MapInfo& MapUpdater::info() const {
  return state_->writer.info();
}
std::uint64_t MapUpdater::revision() const {
  return state_->writer.revision();
}

Result<std::uint32_t> MapUpdater::submap(const std::string& name, const std::optional<PoseChange>& pose) {
  if (name.empty() || name.size() > 255)
    return make_error(ErrorCode::kInvalidArgument, "the name of a submap has 1 to 255 bytes");
  MapInfo info = state_->writer.info();
  if (info.submaps.empty()) info.submaps.emplace_back();  // what the map had before is the first one
  const auto known =
      std::find_if(info.submaps.begin(), info.submaps.end(), [&](const Submap& s) { return s.name == name; });
  const auto number = static_cast<std::uint32_t>(known - info.submaps.begin());
  if (known == info.submaps.end()) {
    if (pose) MAPCODEC_TRY(check_pose(pose->translation_m, pose->rotation_xyzw));
    info.submaps.push_back({name, {0, 0, 0}, {0, 0, 0, 1}, 0, 0});
    MAPCODEC_TRY(state_->writer.set_info(std::move(info)));
    state_->changed = true;
  }
  if (!pose) return number;
  PoseChange change = *pose;
  change.submap = number;
  MAPCODEC_TRY(set_poses(std::span(&change, 1)));
  return number;
}

Status MapUpdater::set_poses(std::span<const PoseChange> poses) {
  MAPCODEC_TRY(check_octree_pose(state_->writer.info(), poses));
  MAPCODEC_TRY(state_->writer.set_poses(poses));
  state_->changed = state_->changed || !poses.empty();
  return {};
}

Status MapUpdater::set_stamps(std::uint32_t submap, double first_s, double last_s) {
  MapInfo info = state_->writer.info();
  if (submap >= info.submaps.size())
    return make_error(ErrorCode::kInvalidArgument, "there is no such submap");
  info.submaps[submap].first_stamp_s = first_s;
  info.submaps[submap].last_stamp_s = last_s;
  state_->changed = true;
  return state_->writer.set_info(std::move(info));
}

Status MapUpdater::insert(PointCloud points, std::uint32_t submap, ScanEnd end) {
  State& s = *state_;
  MAPCODEC_TRY(s.holds_points());
  MAPCODEC_TRY(check_holds_points(s.writer.info(), submap));
  std::uint64_t dropped = 0;
  MAPCODEC_ASSIGN(PointCloud fitted, fit_to_schema(std::move(points), s.schema, dropped));
  s.report.dropped_points += dropped;
  s.report.points_in += fitted.size();
  s.held_points += fitted.size();
  if (!fitted.empty()) s.held.push_back({submap, {s.scan, std::move(fitted)}});
  if (end == ScanEnd::here) ++s.scan;
  return s.held_points >= s.settings.batch_points ? flush() : Status{};
}

void MapUpdater::end_scan() {
  ++state_->scan;
}

Status MapUpdater::erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) {
  MAPCODEC_TRY(state_->holds_points());
  MAPCODEC_TRY(flush());
  return state_->remember(state_->erase(e, submap));
}

void MapUpdater::add_input_bytes(std::uint64_t bytes) {
  state_->input_bytes += bytes;
}

void MapUpdater::set_extra(const std::string& name, Bytes value, bool alone) {
  state_->extras[name] = std::move(value);
  if (alone) state_->changed = true;
}

Status MapUpdater::flush() {
  MAPCODEC_TRY(state_->failed);
  return state_->remember(state_->flush());
}

Status MapUpdater::fold(std::size_t least) {
  MAPCODEC_TRY(flush());
  return state_->remember(state_->fold(least));
}

Result<UpdateReport> MapUpdater::commit(std::int64_t timestamp_s) {
  State& s = *state_;
  MAPCODEC_TRY(flush());
  if (s.settings.fold_after > 0) MAPCODEC_TRY(fold(s.settings.fold_after));
  UpdateReport report = std::exchange(s.report, {});
  report.revision = s.writer.revision();
  if (!s.changed) return report;
  MapInfo info = s.writer.info();
  info.bounds = s.writer.posed_bounds();
  info.dropped_points += report.dropped_points;
  info.achieved = s.achieved;
  info.input_points = s.input_points;
  info.input_bytes = s.input_bytes;
  info.extras.erase(kLevelsExtra);  // measured on what the map was
  if (s.settings.density_cap && report.points_in > 0) info.extras[kDensityCapExtra] = Bytes{1};
  info.extras.erase(kRmsAccountExtra);
  if (auto account = s.rms.extra()) info.extras[kRmsAccountExtra] = *std::move(account);
  for (auto& [name, value] : s.extras) info.extras[name] = std::move(value);
  s.extras.clear();
  MAPCODEC_TRY(s.writer.set_info(std::move(info)));
  MAPCODEC_ASSIGN(report.revision, s.writer.commit(timestamp_s));
  report.committed = true;
  s.changed = false;
  return report;
}

}  // namespace mapcodec
