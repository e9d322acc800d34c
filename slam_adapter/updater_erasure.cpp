// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/updater_state.hpp"

namespace mapcodec {

Status MapUpdater::State::erase(const std::optional<Erasure>& e, std::optional<std::uint32_t> submap) {
  std::vector<TilePlace> places;
  for (const TileRecord* t : writer.tiles()) {
    if (t->submap != octree && (!submap || t->submap == *submap)) places.push_back({t->submap, t->key});
  }
  for (const TilePlace& p : places) {
    MAPCODEC_TRY(stopped());
    if (!e) {
      changed = true;
      ++report.tiles_removed;
      cache.forget(p);
      MAPCODEC_TRY(writer.remove(p.key, p.submap));
      continue;
    }
    MAPCODEC_ASSIGN(const Erasure local, in_submap(*e, p.submap));
    const TileRecord* record = writer.find(p.key, p.submap);
    // Only the places that the conditions reach are looked at.
    const Box reach = pose_of(writer.info(), p.submap).apply(record->bounds);
    const bool apart = e->box && !e->inverse && !p.key.is_unplaced() && !reach.intersects(*e->box);
    if (!apart) MAPCODEC_TRY(erase_in(*record, local));
  }
  return {};
}

Status MapUpdater::State::erase_in(const TileRecord& tile, const Erasure& e) {
  const TileRecord record = tile;  // the writer's own changes below
  MAPCODEC_ASSIGN(const std::vector<Bytes> segments, read_all(record));
  MAPCODEC_ASSIGN(PointCloud cloud, decode_tile(join_segments(segments), schema));
  const std::size_t before = cloud.size();
  MAPCODEC_TRY(erase_points(cloud, e));
  if (cloud.size() == before) return {};
  changed = true;
  cache.forget({record.submap, record.key});
  if (cloud.empty()) {
    ++report.tiles_removed;
    return writer.remove(record.key, record.submap);
  }
  ++report.tiles_touched;
  const Bytes payload = write_erasure(e);
  report.bytes += payload.size();
  return writer.extend(record.key, cloud.size(), record.bounds, record.errors, payload, record.submap);
}

Result<Erasure> MapUpdater::State::in_submap(const Erasure& e, std::uint32_t submap) const {
  const RigidMotion pose = pose_of(writer.info(), submap);
  Erasure moved = e;
  if (pose.is_identity() || (!e.box && !e.sphere)) return moved;
  const Vec3 t = pose.apply(Vec3{0, 0, 0});
  moved.motion.emplace();
  for (std::size_t column = 0; column < 3; ++column) {
    Vec3 axis{0, 0, 0};
    axis[column] = 1;
    const Vec3 r = pose.rotate(axis);
    for (std::size_t row = 0; row < 3; ++row) (*moved.motion)[3 * row + column] = r[row];
  }
  for (std::size_t d = 0; d < 3; ++d) (*moved.motion)[9 + d] = t[d];
  return moved;
}

}  // namespace mapcodec
