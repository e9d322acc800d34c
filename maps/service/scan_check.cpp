// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/scan_check.hpp"

#include <unordered_set>

#include "maps/moved_points.hpp"
#include "maps/service/writer_table.hpp"

namespace mapcodec {
namespace {

Error bad(const std::string& what) {
  return make_error(ErrorCode::kInvalidArgument, what);
}

Status check_names(const Scan& scan) {
  if (scan.submap.size() > 255) return bad("the name of a submap has at most 255 bytes");
  if (scan.T_map_submap && scan.submap.empty()) return bad("a pose of a submap needs the submap's name");
  if (scan.writer.size() > kMaxWriterName)
    return bad("the name of a writer has at most " + std::to_string(kMaxWriterName) + " bytes");
  for (const auto* pose : {&scan.T_submap_scan, &scan.T_map_submap}) {
    if (*pose) MAPCODEC_TRY(check_pose((*pose)->translation_m, (*pose)->rotation_xyzw));
  }
  return {};
}

Status check_channels(const PointCloud& points) {
  for (const Channel& c : points.channels) {
    if (c.info.stride() == 0 || c.data.size() != c.info.stride() * points.size())
      return make_error(ErrorCode::kMalformed, "channel '" + c.info.name + "' has " +
                                                   std::to_string(c.data.size()) + " bytes for " +
                                                   std::to_string(points.size()) + " points");
  }
  return {};
}

/// @return the box of the points. Errors: a coordinate that is not finite.
Result<Box> finite_bounds(const PointCloud& points) {
  Box box;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_finite(points.xyz[i])) return bad("point " + std::to_string(i) + " is not finite");
    box.add(points.xyz[i]);
  }
  return box;
}

std::array<std::int64_t, 3> cell_of(const Vec3& p, const MapSchema& schema) {
  std::array<std::int64_t, 3> cell{};
  for (std::size_t d = 0; d < 3; ++d)
    cell[d] = static_cast<std::int64_t>(std::floor((p[d] - schema.origin[d]) / schema.tile_size_m));
  return cell;
}

Status check_spread(const PointCloud& points, const Box& box, const MapSchema& schema) {
  for (std::size_t d = 0; d < 3; ++d) {
    const double reach =
        std::max(std::abs(box.min[d] - schema.origin[d]), std::abs(box.max[d] - schema.origin[d]));
    if (!(reach < schema.tile_size_m * double(std::uint32_t{1} << 30)))
      return bad("a point lies too far from the map's origin");
  }
  const auto low = cell_of(box.min, schema), high = cell_of(box.max, schema);
  double cells = 1;
  for (std::size_t d = 0; d < 3; ++d) cells *= double(high[d] - low[d] + 1);
  if (cells <= double(kMaxScanTiles)) return {};
  std::unordered_set<TileKey, TileKeyHash> touched;
  for (const Vec3& p : points.xyz) {
    const auto c = cell_of(p, schema);
    touched.insert({std::int32_t(c[0]), std::int32_t(c[1]), std::int32_t(c[2]), 0});
    if (touched.size() > kMaxScanTiles)
      return make_error(ErrorCode::kLimitExceeded,
                        "the scan touches more than " + std::to_string(kMaxScanTiles) + " tiles");
  }
  return {};
}

void place(Scan& scan) {
  if (!scan.T_submap_scan) return;
  const RigidMotion motion(scan.T_submap_scan->translation_m, scan.T_submap_scan->rotation_xyzw);
  scan.T_submap_scan.reset();
  if (motion.is_identity()) return;
  move_points(scan.points, motion);
  scan.points.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
}

}  // namespace

Status prepare_scan(Scan& scan, const MapSchema& schema, const ServiceSettings& settings,
                    const MapCoding& coding) {
  if (scan.points.size() > settings.max_scan_points)
    return make_error(ErrorCode::kLimitExceeded,
                      "a scan has at most " + std::to_string(settings.max_scan_points) + " points");
  MAPCODEC_TRY(check_names(scan));
  MAPCODEC_TRY(check_channels(scan.points));
  MAPCODEC_TRY(coding.check(scan.points, schema));
  if (scan.points.empty()) return {};
  MAPCODEC_TRY(finite_bounds(scan.points));
  place(scan);
  MAPCODEC_ASSIGN(const Box box, finite_bounds(scan.points));
  return check_spread(scan.points, box, schema);
}

}  // namespace mapcodec
