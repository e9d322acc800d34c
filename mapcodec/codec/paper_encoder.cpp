// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_encoder.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/paper_mesh_encoder.hpp"
#include "mapcodec/codec/paper_planes.hpp"
#include "mapcodec/codec/paper_raw_encoder.hpp"
#include "mapcodec/codec/paper_sections.hpp"
#include "mapcodec/codec/points_encoder.hpp"

namespace mapcodec {
namespace {

using paper::Extraction;
using Color = std::array<std::uint16_t, 3>;

// Rounding to an eighth of the RANSAC threshold moves an outline by 0.04 thresholds RMS, where the points
// themselves stray from the plane by about 0.3 and the reduction moves the outline by up to reduction_m.
constexpr double kStepsPerThreshold = 8;
// The raw form stores floats: its lattice is only to be too fine to matter.
constexpr double kRawStepsPerThreshold = 1024;

Error invalid(const std::string& what) {
  return make_error(ErrorCode::kInvalidArgument, "paper: " + what);
}

bool positive(double x) {
  return x > 0 && std::isfinite(x);
}

Status check_settings(const PaperSettings& s) {
  if (!(s.perc_process >= 0 && s.perc_process <= 1)) return invalid("perc_process must be between 0 and 1");
  if (!positive(s.distance_m) || !positive(s.alpha_m)) return invalid("distance and alpha must be positive");
  if (!positive(s.leftover_step_m)) return invalid("the voxel side of the remaining points must be positive");
  if (!(s.rel_area >= 0) || !(s.reduction_m >= 0))
    return invalid("rel_area and reduction must not be negative");
  if (s.clusters == 0 || s.clusters > 4096) return invalid("clusters must be 1 to 4096");
  return {};
}

Status check_tile(const PointCloud& tile, const MapSchema& schema, const PaperSettings& s) {
  if (tile.empty()) return invalid("a tile without points");
  if (tile.size() > 0xffffffffu) return invalid("more than 2^32 points in a tile");
  if (!paper::can_keep(schema)) return invalid("only colour can be kept");
  if (tile.channels.size() != schema.channels.size())
    return invalid("the points' channels are not the schema's");
  for (const Vec3& p : tile.xyz) {
    if (!is_finite(p)) return invalid("a point that is not finite");
  }
  const Box box = tile.bounds();
  const double smallest = std::min({s.distance_m / kStepsPerThreshold, s.alpha_m / 4,
                                    s.outlier_radius_m > 0 ? s.outlier_radius_m * 4 : s.alpha_m});
  for (std::size_t d = 0; d < 3; ++d) {
    if (!((box.max[d] - box.min[d]) / smallest < 8e6))
      return invalid("the tile is too large for its thresholds");
    if (!(std::abs(box.min[d] - schema.origin[d]) < 1e15))
      return invalid("the tile is too far from the map's origin");
  }
  return {};
}

/// Whole metres from the map's origin, at or below every point.
std::array<std::int64_t, 3> find_corner(const PointCloud& tile, const MapSchema& schema) {
  const Box box = tile.bounds();
  std::array<std::int64_t, 3> corner;
  for (std::size_t d = 0; d < 3; ++d)
    corner[d] = static_cast<std::int64_t>(std::floor(box.min[d] - schema.origin[d]));
  return corner;
}

std::vector<Color> read_colors(const Channel& channel) {
  std::vector<Color> r(channel.size());
  const bool narrow = channel.info.scalar == ScalarType::u8;
  for (std::size_t i = 0; i < r.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      r[i][c] = narrow ? channel.get<std::uint8_t>(i, c) : channel.get<std::uint16_t>(i, c);
    }
  }
  return r;
}

/// A triangle's colour is a mean over many points: rounding it finer than a third of the bound buys nothing.
std::uint32_t choose_color_step(const ChannelSchema& channel) {
  const std::uint32_t unit = channel.info.scalar == ScalarType::u8 ? 1 : 257;
  const double bound = channel.kept == ChannelKept::bounded ? channel.bound : 0;
  return unit * static_cast<std::uint32_t>(std::clamp(bound / 3, 1.0, 16.0));
}

class PaperWriter {
 public:
  PaperWriter(const PointCloud& tile, const MapSchema& schema, const PaperSettings& settings)
      : tile_(tile), schema_(schema), settings_(settings), color_(paper::color_channel(schema)) {}

  Result<PaperEncoding> write() {
    step_m_ = static_cast<float>(settings_.distance_m /
                                 (settings_.raw ? kRawStepsPerThreshold : kStepsPerThreshold));
    corner_ = find_corner(tile_, schema_);
    MAPCODEC_ASSIGN(const Extraction extraction, extract());
    out_.u8(static_cast<std::uint8_t>((settings_.raw ? paper::kFormRaw : 0) |
                                      (has_color() ? paper::kFormColor : 0)));
    PaperEncoding r;
    if (settings_.raw) {
      out_.raw(paper::write_raw(extraction, tile_, channel(), corner(), step_m_));
    } else {
      write_planes(extraction);
      r.stats.plane_bytes = out_.size();
      MAPCODEC_TRY(write_rest(extraction.leftovers));
    }
    count(extraction, r);
    return r;
  }

 private:
  [[nodiscard]] bool has_color() const { return color_ != paper::kNoColor; }
  [[nodiscard]] const Channel* channel() const { return has_color() ? &tile_.channels[color_] : nullptr; }
  [[nodiscard]] Vec3 corner() const {
    Vec3 r;
    for (std::size_t d = 0; d < 3; ++d) r[d] = schema_.origin[d] + static_cast<double>(corner_[d]);
    return r;
  }

  [[nodiscard]] Result<Extraction> extract() const {
    std::vector<Vec3> local;
    local.reserve(tile_.size());
    const Vec3 from = corner();
    for (const Vec3& p : tile_.xyz) local.push_back({p[0] - from[0], p[1] - from[1], p[2] - from[2]});
    const std::vector<Color> colors = has_color() ? read_colors(*channel()) : std::vector<Color>{};
    return paper::extract_planes(local, colors, settings_, step_m_);
  }

  void write_planes(const Extraction& extraction) {
    out_.varint(extraction.planes.size());
    if (extraction.planes.empty()) return;
    for (const std::int64_t c : corner_) out_.signed_varint(c);
    out_.f32(static_cast<float>(step_m_));
    const std::uint32_t color_step = has_color() ? choose_color_step(schema_.channels[color_]) : 0;
    if (has_color()) out_.varint(color_step);
    out_.sized(paper::encode_planes(extraction.planes, color_step));
  }

  Status write_rest(const std::vector<std::uint32_t>& leftovers) {
    if (leftovers.empty()) return {};
    std::vector<Vec3> xyz;
    xyz.reserve(leftovers.size());
    for (const std::uint32_t i : leftovers) xyz.push_back(tile_.xyz[i]);
    const Quantizer lattice{schema_.origin, settings_.leftover_step_m, schema_.coordinates.kind};
    MAPCODEC_ASSIGN(const PointsEncoding points, encode_points(xyz, lattice, PointsSettings{}));
    out_.f64(settings_.leftover_step_m);
    if (!has_color()) {
      out_.raw(points.bytes);
      return {};
    }
    out_.sized(points.bytes);
    return write_colors(leftovers, points);
  }
  Status write_colors(const std::vector<std::uint32_t>& leftovers, const PointsEncoding& points) {
    const ChannelInfo& info = channel()->info;
    Channel values{info, Bytes(points.order.size() * info.stride())};
    for (std::size_t i = 0; i < points.order.size(); ++i) {
      std::memcpy(values.at(i), channel()->at(leftovers[points.order[i]]), info.stride());
    }
    MAPCODEC_ASSIGN(const ChannelEncoding colors,
                    encode_channel(schema_.channels[color_], values, points.voxels, Effort::standard));
    color_bytes_ = colors.bytes.size();
    out_.raw(colors.bytes);
    return {};
  }

  void count(const Extraction& extraction, PaperEncoding& r) {
    r.points = tile_.size();
    r.stats.planes = extraction.planes.size();
    for (const paper::LatticePlane& plane : extraction.planes) r.stats.triangles += plane.triangles.size();
    r.stats.leftover_points = extraction.leftovers.size();
    r.bytes = out_.take();
    if (settings_.raw) {
      const std::size_t stride = has_color() ? channel()->info.stride() : 0;
      color_bytes_ = stride * extraction.leftovers.size();
      r.stats.plane_bytes = r.bytes.size() - (12 + stride) * extraction.leftovers.size();
    }
    r.geometry_bytes = r.bytes.size() - color_bytes_;
  }

  const PointCloud& tile_;
  const MapSchema& schema_;
  const PaperSettings& settings_;
  std::size_t color_;
  double step_m_ = 0;
  std::array<std::int64_t, 3> corner_{};
  std::uint64_t color_bytes_ = 0;
  ByteWriter out_;
};

}  // namespace

Result<PaperEncoding> encode_paper(const PointCloud& tile, const MapSchema& schema,
                                   const PaperSettings& settings) {
  MAPCODEC_TRY(check_settings(settings));
  MAPCODEC_TRY(check_tile(tile, schema, settings));
  return PaperWriter(tile, schema, settings).write();
}

}  // namespace mapcodec
