// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/tile_work.hpp"

#include <algorithm>
#include <cmath>

#include "slam_adapter/point_batch.hpp"

namespace mapcodec {
namespace {

/// All points of a tile, those first that no folding will move.
Status add_segments(StoredPoints& stored, const std::vector<Bytes>& segments, const MapSchema& schema) {
  const Bytes joined = join_segments(segments);
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> all, split_segments(joined));
  PointCloud parts[2] = {schema.layout(), schema.layout()};
  for (const ByteSpan s : all) {
    if (is_erasure(s)) {
      MAPCODEC_ASSIGN(const Erasure e, read_erasure(s));
      for (PointCloud& part : parts) MAPCODEC_TRY(erase_points(part, e));
      continue;
    }
    MAPCODEC_ASSIGN(const PointCloud cloud, decode_tile(s, schema));
    parts[is_pending(s)].append(cloud);
  }
  stored.add(parts[0], false);
  stored.add(parts[1], true);
  return {};
}

/// Weighted mean of two figures.
double mean_of(double a, double weight_a, double b, double weight_b) {
  return weight_a + weight_b > 0 ? (a * weight_a + b * weight_b) / (weight_a + weight_b) : 0;
}

double root_mean(double a, double weight_a, double sum_b, double weight_b) {
  return weight_a + weight_b > 0 ? std::sqrt((a * a * weight_a + sum_b) / (weight_a + weight_b)) : 0;
}

std::shared_ptr<StoredPoints> nothing_stored(const TileWork& w, const MapSchema& schema) {
  const Box cube = w.place.key.is_unplaced() ? Box{{0, 0, 0}, {0, 0, 0}}
                                             : tile_cube(w.place.key, schema.origin, schema.tile_size_m);
  return make_stored_points(schema, cube.min);
}

// Squared distances to surfaces spread about as widely as their mean: so many standard errors of it.
constexpr double kChance = 1.5;
constexpr std::size_t kFew = 2000;  // of more points the mean is certain enough

double rms_by_chance(const TileWork& w, const ScanPart& scan) {
  if (!is_by_chance(w, scan)) return 0;
  return w.allowed_rms_m * std::sqrt(1 + kChance / std::sqrt(double(scan.points.size())));
}

/// What of one scan is new.
PointCloud take_new(TileWork& w, ScanPart part, const MapSchema& schema) {
  const double by_chance_m = rms_by_chance(w, part);
  PointCloud scan = std::move(part.points);
  if (w.stored == nullptr) return scan;
  const bool with_channels = schema.promise == PromiseKind::lossless;
  const Novelty novelty = with_channels ? w.stored->look(without_dropped(scan, schema), w.allowed_rms_m)
                                        : w.stored->look(scan, w.allowed_rms_m, by_chance_m);
  w.known += double(scan.size() - novelty.added.size());
  w.known_m2 += novelty.squared_m2;
  return novelty.added.size() == scan.size() ? std::move(scan) : scan.gather(novelty.added);
}

}  // namespace

bool is_by_chance(const TileWork& w, const ScanPart& scan) {
  return w.by_chance && !scan.points.empty() && scan.points.size() <= kFew;
}

Status look_up(TileWork& w, const MapSchema& schema, const PendingCoding& coding) {
  if (w.stored == nullptr && !w.segments.empty()) {
    w.stored = nothing_stored(w, schema);
    MAPCODEC_TRY(add_segments(*w.stored, w.segments, schema));
    w.segments.clear();
  }
  for (std::size_t i = 0; i < w.scans.size(); ++i) {
    PointCloud added = take_new(w, std::move(w.scans[i]), schema);
    const bool more = i + 1 < w.scans.size();
    // A tile that begins with one scan needs no index of it.
    if (w.cap && more && w.stored == nullptr) w.stored = nothing_stored(w, schema);
    if (w.stored != nullptr && !added.empty()) w.stored->add(as_decoded(added, schema, coding), true);
    if (i == 0) {
      w.added = std::move(added);
    } else {
      w.added.append(added);
    }
  }
  w.scans.clear();
  w.added_points = double(w.added.size());
  return {};
}

Status code_added(TileWork& w, const MapSchema& schema, const PendingCoding& coding, bool for_good) {
  if (w.added.empty()) return {};
  if (for_good && w.begins) {
    MAPCODEC_ASSIGN(w.coded, encode_for_good(std::move(w.added), schema, false, w.borders));
    return {};
  }
  MAPCODEC_ASSIGN(EncodedTile t, encode_tile(w.added, coding.schema, coding.tiles));
  mark_pending(t.bytes);
  w.added = {};
  w.coded = std::move(t);
  return {};
}

TileErrors joint_errors(const TileErrors& old, double old_points, double old_stored, const TileWork& w,
                        double farthest_m) {
  const TileErrors add = w.coded ? w.coded->errors : TileErrors{};
  const double added = w.added_points;
  TileErrors e;
  const double squares = added * add.rms_m * add.rms_m;
  const double forward = root_mean(old.rms_m, old_points, w.known_m2 + squares, w.known + added);
  e.rms_m = std::max(forward, root_mean(old.rms_m, old_stored, squares, added));
  e.max_axis_error_m = std::max({old.max_axis_error_m, add.max_axis_error_m, w.known > 0 ? farthest_m : 0});
  e.color_error = mean_of(old.color_error, old_points, add.color_error, added);
  e.density_error = mean_of(old.density_error, old_points, add.density_error, added);
  return e;
}

}  // namespace mapcodec
