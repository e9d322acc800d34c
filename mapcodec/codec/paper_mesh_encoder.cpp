// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_mesh_encoder.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "mapcodec/codec/paper_region.hpp"

namespace mapcodec::paper {
namespace {

constexpr std::uint32_t kNoTriangle = ~std::uint32_t{0};

class PlaneEncoder {
 public:
  PlaneEncoder(RangeEncoder& out, Models& models, std::uint32_t color_step)
      : out_(out), models_(models), color_step_(color_step) {}

  void encode(const LatticePlane& plane) {
    plane_ = &plane;
    index_edges();
    encode_header();
    const std::vector<std::uint32_t> seeds = find_seeds();
    models_.components.encode(out_, seeds.size() - 1);
    last_vertex_ = plane.low;
    last_ = Shade{};
    coded_vertices_.clear();
    shades_.clear();
    for (const std::uint32_t seed : seeds) encode_component(seed);
  }

 private:
  /// Colour in colour steps and the class of density.
  struct Shade {
    std::array<std::int64_t, 3> color{};
    std::int64_t density = 0;
  };

  static std::uint64_t key(std::uint32_t a, std::uint32_t b) { return std::uint64_t{a} << 32 | b; }

  void index_edges() {
    triangle_at_.clear();
    total_area_ = 0;
    for (std::uint32_t t = 0; t < plane_->triangles.size(); ++t) {
      const auto& v = plane_->triangles[t].vertices;
      for (std::size_t i = 0; i < 3; ++i) triangle_at_[key(v[i], v[(i + 1) % 3])] = t;
      total_area_ += static_cast<double>(area(plane_->triangles[t]));
    }
  }
  std::int64_t area(const LatticeTriangle& t) const {
    const auto& v = plane_->vertices;
    return doubled_area(v[t.vertices[0]], v[t.vertices[1]], v[t.vertices[2]]);
  }
  std::uint32_t triangle_at(std::uint32_t from, std::uint32_t to) const {
    const auto found = triangle_at_.find(key(from, to));
    return found == triangle_at_.end() ? kNoTriangle : found->second;
  }

  /// One triangle of each edge-connected component.
  std::vector<std::uint32_t> find_seeds() const {
    std::vector<std::uint32_t> seeds, stack;
    std::vector<bool> seen(plane_->triangles.size());
    for (std::uint32_t t = 0; t < seen.size(); ++t) {
      if (seen[t]) continue;
      seeds.push_back(t);
      stack.push_back(t);
      seen[t] = true;
      while (!stack.empty()) {
        const auto v = plane_->triangles[stack.back()].vertices;
        stack.pop_back();
        for (std::size_t i = 0; i < 3; ++i) {
          const std::uint32_t n = triangle_at(v[(i + 1) % 3], v[i]);
          if (n == kNoTriangle || seen[n]) continue;
          seen[n] = true;
          stack.push_back(n);
        }
      }
    }
    return seeds;
  }

  void encode_header() {
    out_.encode_raw(plane_->axis, 2);
    models_.low[0].encode_signed(out_, plane_->low.u);
    models_.low[1].encode_signed(out_, plane_->low.v);
    models_.span[0].encode(out_, static_cast<std::uint64_t>(plane_->span.u - 1));
    models_.span[1].encode(out_, static_cast<std::uint64_t>(plane_->span.v - 1));
    for (std::size_t i = 0; i < 3; ++i) models_.height[i].encode_signed(out_, plane_->heights[i]);
    models_.points.encode(out_, plane_->points - 1);
  }

  void encode_component(std::uint32_t seed) {
    coded_index_.clear();
    first_vertex_ = static_cast<std::uint32_t>(coded_vertices_.size());
    const auto& corners = plane_->triangles[seed].vertices;
    for (std::size_t i = 0; i < 3; ++i) encode_seed_vertex(corners[i], i > 0);
    encode_shade(seed, last_);
    last_ = shades_.back();
    grower_.seed({first_vertex_, first_vertex_ + 1, first_vertex_ + 2}, index_of_last());
    Gate gate;
    while (grower_.pop(gate)) encode_gate(gate);
  }
  std::uint32_t index_of_last() const { return static_cast<std::uint32_t>(shades_.size() - 1); }

  void encode_seed_vertex(std::uint32_t vertex, std::size_t context) {
    const LatticeVertex& at = plane_->vertices[vertex];
    models_.seed[context].encode_signed(out_, at.u - last_vertex_.u);
    models_.seed[context].encode_signed(out_, at.v - last_vertex_.v);
    add_vertex(vertex);
    last_vertex_ = at;
  }
  void add_vertex(std::uint32_t vertex) {
    coded_index_[vertex] = static_cast<std::uint32_t>(coded_vertices_.size());
    coded_vertices_.push_back(plane_->vertices[vertex]);
    source_.resize(coded_vertices_.size());
    source_.back() = vertex;
  }

  void encode_gate(const Gate& gate) {
    const Candidates candidates = grower_.candidates(gate, coded_vertices_);
    const std::size_t context = candidates.context();
    const std::uint32_t t = triangle_at(source_[gate.to], source_[gate.from]);
    const bool has_neighbor = t != kNoTriangle;
    out_.encode(has_neighbor, models_.neighbor[context][had_neighbor_]);
    had_neighbor_ = has_neighbor;
    if (!has_neighbor) return;
    const std::uint32_t apex =
        encode_apex(gate, candidates, apex_of(t, source_[gate.to], source_[gate.from]));
    encode_shade(t, shades_[gate.triangle]);
    grower_.grow(gate, apex, index_of_last());
  }
  std::uint32_t apex_of(std::uint32_t t, std::uint32_t a, std::uint32_t b) const {
    for (const std::uint32_t v : plane_->triangles[t].vertices) {
      if (v != a && v != b) return v;
    }
    return a;
  }

  /// @return the apex among the coded vertices.
  std::uint32_t encode_apex(const Gate& gate, const Candidates& candidates, std::uint32_t vertex) {
    const std::size_t context = candidates.context();
    const auto known = coded_index_.find(vertex);
    const std::uint32_t apex = known == coded_index_.end() ? kNoVertex : known->second;
    if (candidates.any()) {
      const bool is_candidate = apex != kNoVertex && (apex == candidates.next || apex == candidates.previous);
      out_.encode(is_candidate, models_.is_candidate[context]);
      if (is_candidate) {
        if (candidates.differ()) out_.encode(apex == candidates.previous, models_.is_previous[context]);
        return apex;
      }
    }
    out_.encode(apex == kNoVertex, models_.is_new[context]);
    if (apex == kNoVertex) return encode_new_vertex(gate, vertex);
    out_.encode_raw(apex - first_vertex_, std::bit_width(coded_vertices_.size() - first_vertex_ - 1));
    return apex;
  }

  std::uint32_t encode_new_vertex(const Gate& gate, std::uint32_t vertex) {
    const LatticeVertex &a = coded_vertices_[gate.from], &b = coded_vertices_[gate.to];
    const LatticeVertex expected = predict_apex(a, b, coded_vertices_[gate.opposite]);
    auto& models = models_.apex[length_class(a, b)];
    models[0].encode_signed(out_, plane_->vertices[vertex].u - expected.u);
    models[1].encode_signed(out_, plane_->vertices[vertex].v - expected.v);
    add_vertex(vertex);
    return coded_index_[vertex];
  }

  void encode_shade(std::uint32_t t, const Shade& expected) {
    const LatticeTriangle& triangle = plane_->triangles[t];
    Shade s;
    s.density = density(triangle);
    models_.density.encode_signed(out_, s.density - expected.density);
    if (color_step_ > 0) encode_color(triangle, expected, s);
    shades_.push_back(s);
  }
  void encode_color(const LatticeTriangle& triangle, const Shade& expected, Shade& s) {
    for (std::size_t c = 0; c < 3; ++c) s.color[c] = (triangle.rgb[c] + color_step_ / 2) / color_step_;
    const std::int64_t green = s.color[1] - expected.color[1];
    models_.color[1].encode_signed(out_, green);
    models_.color[0].encode_signed(out_, s.color[0] - expected.color[0] - green);
    models_.color[2].encode_signed(out_, s.color[2] - expected.color[2] - green);
  }
  std::int64_t density(const LatticeTriangle& t) const {
    const double relative = static_cast<double>(t.points) / static_cast<double>(area(t)) /
                            (static_cast<double>(plane_->points) / total_area_);
    const auto d = std::llround(std::log2(relative) * static_cast<double>(kDensityPerOctave));
    return std::clamp<std::int64_t>(d, -kMaxDensity, kMaxDensity);
  }

  RangeEncoder& out_;
  Models& models_;
  std::uint32_t color_step_;
  const LatticePlane* plane_ = nullptr;
  std::map<std::uint64_t, std::uint32_t> triangle_at_;  ///< by directed edge
  double total_area_ = 0;
  RegionGrower grower_;
  std::map<std::uint32_t, std::uint32_t>
      coded_index_;  ///< of the plane's vertices that this component has reached
  std::vector<LatticeVertex> coded_vertices_;
  std::vector<std::uint32_t> source_;  ///< the plane's vertex of each coded one
  std::uint32_t first_vertex_ = 0;     ///< of this component
  std::vector<Shade> shades_;          ///< of the coded triangles
  Shade last_;
  LatticeVertex last_vertex_;
  bool had_neighbor_ = true;
};

}  // namespace

Bytes encode_planes(std::span<const LatticePlane> planes, std::uint32_t color_step) {
  RangeEncoder out;
  Models models;
  PlaneEncoder encoder(out, models, color_step);
  std::uint64_t triangles = 0;
  for (const LatticePlane& plane : planes) {
    encoder.encode(plane);
    triangles += plane.triangles.size();
  }
  Bytes bytes = out.finish();
  while (triangles > max_triangles(bytes.size())) bytes.push_back(0);
  return bytes;
}

}  // namespace mapcodec::paper
