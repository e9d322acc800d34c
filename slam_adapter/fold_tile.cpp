// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/fold_tile.hpp"

#include <algorithm>
#include <cmath>

#include "mapcodec/geometry/quantizer.hpp"
#include "mapcodec/quality/novelty.hpp"
#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/point_batch.hpp"

namespace mapcodec {
namespace {

// Pending positions have so much less than the promise that folding may add nearly all of it, since the two
// errors are independent: 0.15^2 + 0.98^2 < 1. (A quarter would save two bits a point until folding, and cost
// a twentieth of the size for good.)
constexpr double kPendingRms = 0.15;
// Colour errors are mean distances: they add up.
constexpr double kPendingColor = 0.3, kFoldedColor = 0.7;
// A uniform cell's root mean square distance from its centre, in sides.
constexpr double kRmsOfCell = 0.5;

ChannelSchema* bounded_color(MapSchema& schema) {
  for (ChannelSchema& c : schema.channels) {
    if (c.info.name == "rgb" && c.kept == ChannelKept::bounded) return &c;
  }
  return nullptr;
}

MapSchema with_color_share(MapSchema schema, double share) {
  if (ChannelSchema* color = bounded_color(schema)) color->bound *= share;
  return schema;
}

/// Dropped channels are gone; encoders want them in their places all the same.
PointCloud with_all_channels(PointCloud cloud, const MapSchema& schema) {
  std::vector<Channel> channels;
  std::size_t next = 0;
  for (const ChannelSchema& c : schema.channels) {
    if (c.kept == ChannelKept::dropped) {
      channels.push_back({c.info, Bytes(c.info.stride() * cloud.size())});
    } else {
      channels.push_back(std::move(cloud.channels[next++]));
    }
  }
  cloud.channels = std::move(channels);
  return cloud;
}

/// The cheapest coding of a tile whose own error keeps to `rms_m`.
class TileForRms {
 public:
  TileForRms(const PointCloud& tile, const MapSchema& schema, double rms_m)
      : tile_(tile), schema_(schema), bare_(positions_alone(schema)), rms_m_(rms_m) {}

  Result<EncodedTile> encode() {
    try_points();
    try_surfaces();
    if (!best_) return make_error(ErrorCode::kPromiseBroken, "no coding of a tile keeps the promise");
    return encode_tile(tile_, schema_, settings_);
  }

 private:
  bool consider(const TileSettings& settings, const EncodedTile& t) {
    const double rms = std::max(t.rms_forward_m, t.rms_backward_m);
    if (rms <= rms_m_ && (!best_ || t.bytes.size() < *best_)) {
      best_ = t.bytes.size();
      settings_ = settings;
    }
    return rms <= rms_m_ && rms >= 0.975 * rms_m_;
  }

  void try_points() {
    TileSettings s;
    s.step_m = 0.995 * rms_m_ / kRmsOfCell;
    for (int i = 0; i < 3; ++i) {
      const auto t = encode_tile(tile_, bare_, s);
      if (!t.ok()) return;
      if (consider(s, *t) || t->errors.rms_m <= rms_m_) return;
      s.step_m *= 0.995 * rms_m_ / t->errors.rms_m;  // clusters off the cells' centres
    }
  }

  void try_surfaces() {
    constexpr double kClearlyPoints = 1.6;
    TileSettings s;
    s.codec = CodecId::surface;
    s.step_m = schema_.step_m > 0 ? schema_.step_m : 0.5 * rms_m_;
    LogSecant secant(0.99 * rms_m_, 0.8);
    for (int i = 0; i < 6; ++i) {
      const auto t = encode_tile(tile_, bare_, s);
      if (!t.ok() || consider(s, *t)) return;
      const double rms = std::max(t->rms_forward_m, t->rms_backward_m);
      const bool hopeless =
          rms > rms_m_ && best_ && double(t->bytes.size()) > kClearlyPoints * double(*best_);
      if (hopeless) return;
      s.step_m = secant.next(s.step_m, rms);
    }
  }

  const PointCloud& tile_;
  const MapSchema& schema_;
  const MapSchema bare_;
  const double rms_m_;
  TileSettings settings_;
  std::optional<std::size_t> best_;
};

/// A tile's segments, sorted into what stays and what is coded again.
struct Parts {
  std::vector<Bytes> kept;            ///< folded before, and erasures that concern them
  std::optional<PointCloud> pending;  ///< the points to be coded
  bool any_pending = false;

  Status take(ByteSpan segment, const MapSchema& schema, bool everything) {
    if (is_erasure(segment)) return erase(segment);
    any_pending = any_pending || is_pending(segment);
    if (!everything && !is_pending(segment)) {
      kept.emplace_back(segment.begin(), segment.end());
      return {};
    }
    MAPCODEC_ASSIGN(PointCloud cloud, decode_tile(segment, schema));
    if (pending) {
      pending->append(cloud);
    } else {
      pending = std::move(cloud);
    }
    return {};
  }

  Status erase(ByteSpan segment) {
    MAPCODEC_ASSIGN(const Erasure e, read_erasure(segment));
    if (pending) MAPCODEC_TRY(erase_points(*pending, e));
    if (!kept.empty()) kept.emplace_back(segment.begin(), segment.end());
    return {};
  }
};

}  // namespace

bool has_bounded_color(const MapSchema& schema) {
  MapSchema copy = schema;
  return bounded_color(copy) != nullptr;
}

bool is_exact_again(const MapSchema& schema) {
  return schema.promise == PromiseKind::lossless ||
         (schema.promise == PromiseKind::max_error && !has_bounded_color(schema));
}

Result<EncodedTile> encode_for_good(PointCloud points, const MapSchema& schema, bool from_pending) {
  const PointCloud tile = with_all_channels(std::move(points), schema);
  TileSettings s;
  switch (schema.promise) {
    case PromiseKind::lossless:
      s.codec = CodecId::lossless;
      return encode_tile(tile, schema, s);
    case PromiseKind::rms: {
      const MapSchema target = with_color_share(schema, from_pending ? kFoldedColor : 1);
      return TileForRms(tile, target, (from_pending ? kFoldedShare : 1) * schema.promise_value).encode();
    }
    default:
      return encode_tile(tile, with_color_share(schema, from_pending ? kFoldedColor : 1), s);
  }
}

Result<EncodedTile> encode_pending(PointCloud points, const MapSchema& schema, const PendingCoding& coding) {
  MAPCODEC_ASSIGN(EncodedTile t,
                  encode_tile(with_all_channels(std::move(points), schema), coding.schema, coding.tiles));
  mark_pending(t.bytes);
  return t;
}

TileErrors joint_errors(const TileErrors& tile, const TileErrors& again, double share) {
  return {std::sqrt(tile.rms_m * tile.rms_m + share * again.rms_m * again.rms_m),
          tile.max_axis_error_m + again.max_axis_error_m, tile.color_error + share * again.color_error,
          tile.density_error + share * again.density_error};
}

Result<PendingCoding> pending_coding(const MapSchema& schema, Effort effort) {
  PendingCoding p;
  p.schema = with_color_share(schema, kPendingColor);
  p.tiles.effort = effort;
  switch (schema.promise) {
    case PromiseKind::paper:
      return make_error(
          ErrorCode::kUnsupported,
          "a map by the paper's method cannot be updated: its planes are those of a whole scan");
    case PromiseKind::lossless:
      p.tiles.codec = CodecId::lossless;
      break;
    case PromiseKind::rms:
      p.rms_m = kPendingRms * schema.promise_value;
      p.tiles.step_m = p.rms_m / kRmsOfCell;
      break;
    case PromiseKind::max_error:
      break;
  }
  return p;
}

PointCloud as_decoded(const PointCloud& points, const MapSchema& schema, const PendingCoding& coding) {
  if (coding.tiles.codec == CodecId::lossless) return without_dropped(points, schema);
  const double step_m = coding.tiles.step_m > 0 ? coding.tiles.step_m : schema.step_m;
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  PointCloud decoded;
  decoded.xyz.reserve(points.size());
  for (const Vec3& p : points.xyz) {
    Vec3& q = decoded.xyz.emplace_back();
    for (std::size_t d = 0; d < 3; ++d) q[d] = lattice.centre(lattice.lattice(p[d], d), d);
  }
  return decoded;
}

Result<std::optional<Fold>> fold_tile(const std::vector<Bytes>& segments, const MapSchema& schema,
                                      const TileErrors& errors, const Box& bounds) {
  const Bytes joined = join_segments(segments);
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> all, split_segments(joined));
  if (segments.size() == 1 && std::none_of(all.begin(), all.end(), is_pending)) return std::optional<Fold>{};
  const bool everything = is_exact_again(schema);
  Parts parts;
  for (const ByteSpan s : all) MAPCODEC_TRY(parts.take(s, schema, everything));
  Fold fold;
  fold.errors = errors;
  fold.bounds = bounds;
  TileErrors again;
  double coded = 0;
  if (parts.pending && !parts.pending->empty()) {
    MAPCODEC_ASSIGN(EncodedTile t, encode_for_good(std::move(*parts.pending), schema, parts.any_pending));
    fold.bounds.add(t.bounds);
    parts.kept.push_back(std::move(t.bytes));
    again = t.errors;
    coded = static_cast<double>(t.points);
  }
  if (parts.kept.empty()) return std::optional<Fold>{std::move(fold)};
  fold.bytes = join_segments(parts.kept);
  fold.codec = fold.bytes[0];
  MAPCODEC_ASSIGN(const PointCloud left, decode_tile(fold.bytes, schema));
  fold.points = left.size();
  if (!everything && fold.points > 0) {
    fold.errors = joint_errors(errors, again, std::min(1.0, coded / static_cast<double>(fold.points)));
  }
  return std::optional<Fold>{std::move(fold)};
}

}  // namespace mapcodec
