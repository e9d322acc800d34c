// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_mesh_decoder.hpp"

#include <algorithm>

#include "mapcodec/codec/paper_region.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec::paper {
namespace {

/// Colour in colour steps and the class of density.
struct Shade {
  std::array<std::int64_t, 3> color{};
  std::int64_t density = 0;
};

/// Decodes one plane. Any doubt clears good_, and every loop ends on that.
class PlaneDecoder {
 public:
  PlaneDecoder(RangeDecoder& in, Models& models, std::uint64_t triangles_left, std::uint32_t color_step,
               std::uint32_t max_color)
      : in_(in),
        models_(models),
        triangles_left_(triangles_left),
        color_step_(color_step),
        max_color_(max_color) {}

  /// False: the bytes are not what an encoder wrote.
  bool decode(LatticePlane& plane, std::uint64_t max_points) {
    plane_ = &plane;
    if (!decode_header(max_points)) return false;
    const std::uint64_t more = models_.components.decode(in_);
    last_vertex_ = plane.low;
    last_ = Shade{};
    shades_.clear();
    decode_component();
    for (std::uint64_t i = 0; i < more && alive(); ++i) decode_component();
    if (!alive()) return false;
    share_points();
    return true;
  }

 private:
  bool alive() {
    good_ = good_ && in_.ok();
    return good_;
  }
  /// `base + delta`, if it stays on the lattice.
  std::int64_t moved(std::int64_t base, std::int64_t delta) {
    if (delta > 4 * kMaxLattice || delta < -4 * kMaxLattice) {
      good_ = false;
      return base;
    }
    const std::int64_t v = base + delta;
    if (v <= kMaxLattice && v >= -kMaxLattice) return v;
    good_ = false;
    return base;
  }
  std::int64_t span(IntegerModel& model) {
    const std::uint64_t v = model.decode(in_);
    if (v < 2 * kMaxLattice) return static_cast<std::int64_t>(v) + 1;
    good_ = false;
    return 1;
  }

  bool decode_header(std::uint64_t max_points) {
    plane_->axis = static_cast<std::uint32_t>(in_.decode_raw(2));
    plane_->low.u = moved(0, models_.low[0].decode_signed(in_));
    plane_->low.v = moved(0, models_.low[1].decode_signed(in_));
    plane_->span.u = span(models_.span[0]);
    plane_->span.v = span(models_.span[1]);
    for (std::size_t i = 0; i < 3; ++i) {
      plane_->heights[i] = models_.height[i].decode_signed(in_);
      good_ = good_ && plane_->heights[i] <= kMaxHeight && plane_->heights[i] >= -kMaxHeight;
    }
    const std::uint64_t more = models_.points.decode(in_);
    good_ = good_ && plane_->axis < 3 && more < max_points;
    plane_->points = good_ ? more + 1 : 0;
    return alive();
  }

  void decode_component() {
    first_vertex_ = static_cast<std::uint32_t>(plane_->vertices.size());
    for (std::size_t i = 0; i < 3; ++i) decode_seed_vertex(i > 0);
    add_triangle({first_vertex_, first_vertex_ + 1, first_vertex_ + 2}, last_);
    if (!alive()) return;
    last_ = shades_.back();
    grower_.seed({first_vertex_, first_vertex_ + 1, first_vertex_ + 2}, index_of_last());
    Gate gate;
    while (grower_.pop(gate) && alive()) decode_gate(gate);
  }
  [[nodiscard]] std::uint32_t index_of_last() const { return static_cast<std::uint32_t>(shades_.size() - 1); }

  void decode_seed_vertex(std::size_t context) {
    last_vertex_.u = moved(last_vertex_.u, models_.seed[context].decode_signed(in_));
    last_vertex_.v = moved(last_vertex_.v, models_.seed[context].decode_signed(in_));
    plane_->vertices.push_back(last_vertex_);
  }

  void decode_gate(const Gate& gate) {
    const Candidates candidates = grower_.candidates(gate, plane_->vertices);
    const bool has_neighbor = in_.decode(models_.neighbor[candidates.context()][had_neighbor_]);
    had_neighbor_ = has_neighbor;
    if (!has_neighbor) return;
    const std::uint32_t apex = decode_apex(gate, candidates);
    if (!good_) return;
    add_triangle({gate.to, gate.from, apex}, shades_[gate.triangle]);
    if (good_) grower_.grow(gate, apex, index_of_last());
  }

  std::uint32_t decode_apex(const Gate& gate, const Candidates& candidates) {
    const std::size_t context = candidates.context();
    if (candidates.any() && in_.decode(models_.is_candidate[context])) {
      if (!candidates.differ()) return candidates.only();
      return in_.decode(models_.is_previous[context]) ? candidates.previous : candidates.next;
    }
    if (in_.decode(models_.is_new[context])) return decode_new_vertex(gate);
    const std::size_t known = plane_->vertices.size() - first_vertex_;
    const std::uint64_t i = in_.decode_raw(std::bit_width(known - 1));
    good_ = good_ && i < known;
    return first_vertex_ + static_cast<std::uint32_t>(good_ ? i : 0);
  }

  std::uint32_t decode_new_vertex(const Gate& gate) {
    const LatticeVertex a = plane_->vertices[gate.from];
    const LatticeVertex b = plane_->vertices[gate.to];
    LatticeVertex p = predict_apex(a, b, plane_->vertices[gate.opposite]);
    auto& models = models_.apex[length_class(a, b)];
    p.u = moved(p.u, models[0].decode_signed(in_));
    p.v = moved(p.v, models[1].decode_signed(in_));
    plane_->vertices.push_back(p);
    return static_cast<std::uint32_t>(plane_->vertices.size() - 1);
  }

  void add_triangle(const std::array<std::uint32_t, 3>& v, const Shade& expected) {
    const auto& at = plane_->vertices;
    // Every triangle stands for a point at least: this bounds the memory by the declared points.
    good_ =
        good_ && plane_->triangles.size() < plane_->points && doubled_area(at[v[0]], at[v[1]], at[v[2]]) > 0;
    good_ = good_ && triangles_left_-- > 0;
    Shade s;
    s.density = expected.density + bounded(models_.density.decode_signed(in_));
    good_ = good_ && s.density <= kMaxDensity && s.density >= -kMaxDensity;
    if (color_step_ > 0) decode_color(expected, s);
    if (!alive()) return;
    shades_.push_back(s);
    plane_->triangles.push_back({v, rgb(s), 0});
  }
  std::int64_t bounded(std::int64_t delta) {
    if (delta <= kMaxLattice && delta >= -kMaxLattice) return delta;
    good_ = false;
    return 0;
  }
  void decode_color(const Shade& expected, Shade& s) {
    const std::int64_t green = bounded(models_.color[1].decode_signed(in_));
    s.color[1] = expected.color[1] + green;
    s.color[0] = expected.color[0] + green + bounded(models_.color[0].decode_signed(in_));
    s.color[2] = expected.color[2] + green + bounded(models_.color[2].decode_signed(in_));
    for (const std::int64_t c : s.color) good_ = good_ && c >= 0 && c <= max_color_;
  }
  [[nodiscard]] std::array<std::uint16_t, 3> rgb(const Shade& s) const {
    std::array<std::uint16_t, 3> v{};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::int64_t full = s.color[c] * std::int64_t{color_step_};
      v[c] = static_cast<std::uint16_t>(std::min<std::int64_t>(full, max_color_));
    }
    return v;
  }

  void share_points() {
    std::vector<std::uint64_t> weights(plane_->triangles.size());
    const auto& at = plane_->vertices;
    std::uint64_t largest = 0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const auto& v = plane_->triangles[i].vertices;
      weights[i] = static_cast<std::uint64_t>(doubled_area(at[v[0]], at[v[1]], at[v[2]]));
      largest = std::max(largest, weights[i]);
    }
    const int shift = std::max(0, static_cast<int>(std::bit_width(largest)) - 40);
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weights[i] = density_weight(weights[i] >> shift, shades_[i].density);
    }
    const std::vector<std::uint32_t> shares = apportion(weights, plane_->points);
    for (std::size_t i = 0; i < shares.size(); ++i) plane_->triangles[i].points = shares[i];
  }

  RangeDecoder& in_;
  Models& models_;
  std::uint64_t triangles_left_;
  std::uint32_t color_step_;
  std::uint32_t max_color_;
  LatticePlane* plane_ = nullptr;
  RegionGrower grower_;
  std::uint32_t first_vertex_ = 0;  ///< of this component
  std::vector<Shade> shades_;       ///< of the decoded triangles
  Shade last_;
  LatticeVertex last_vertex_;
  bool had_neighbor_ = true;
  bool good_ = true;
};

}  // namespace

Result<std::vector<LatticePlane>> decode_planes(ByteSpan bytes, std::uint64_t planes,
                                                std::uint64_t max_points, std::uint64_t max_bytes,
                                                std::uint32_t color_step, std::uint32_t max_color) {
  RangeDecoder in(bytes);
  Models models;
  constexpr std::uint64_t kBytesPerTriangle = 512;  // with the sets of open edges
  const std::uint64_t most = std::min(max_triangles(bytes.size()), max_bytes / kBytesPerTriangle);
  PlaneDecoder decoder(in, models, most, color_step, max_color);
  std::vector<LatticePlane> r;
  for (std::uint64_t i = 0; i < planes; ++i) {
    if (!decoder.decode(r.emplace_back(), max_points)) {
      return make_error(in.ok() ? ErrorCode::kMalformed : ErrorCode::kTruncated,
                        "paper: plane stream is damaged");
    }
    max_points -= r.back().points;
  }
  return r;
}

}  // namespace mapcodec::paper
