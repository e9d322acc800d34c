// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mesh_weld.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "slam_adapter/plane_moments.hpp"

namespace mapcodec {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

/// Vertices in the cells of a hash grid.
class VertexGrid {
 public:
  explicit VertexGrid(double cell) : cell_(cell) {}

  void insert(const Vec3& p, std::uint32_t vertex) {
    std::uint32_t& head = heads_.try_emplace(key(cell_of(p)), kNone).first->second;
    if (next_.size() <= vertex) next_.resize(vertex + 1, kNone);
    next_[vertex] = head;
    head = vertex;
  }
  /// Calls f(vertex) for all within a cell's side of `p`, and for some beyond.
  template <class F>
  void around(const Vec3& p, F&& f) const {
    const Cell c = cell_of(p);
    for (std::int64_t x = -1; x <= 1; ++x) {
      for (std::int64_t y = -1; y <= 1; ++y) {
        for (std::int64_t z = -1; z <= 1; ++z) {
          const auto it = heads_.find(key({c[0] + x, c[1] + y, c[2] + z}));
          for (std::uint32_t v = it == heads_.end() ? kNone : it->second; v != kNone; v = next_[v]) f(v);
        }
      }
    }
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  [[nodiscard]] Cell cell_of(const Vec3& p) const {
    Cell c;
    for (std::size_t d = 0; d < 3; ++d) c[d] = static_cast<std::int64_t>(std::floor(p[d] / cell_));
    return c;
  }
  // Cells whose keys agree by chance only make lists longer.
  static std::uint64_t key(const Cell& c) {
    std::uint64_t h = 0;
    for (const std::int64_t v : c) {
      h = (h ^ static_cast<std::uint64_t>(v)) * 0x9e3779b97f4a7c15u;
      h ^= h >> 31;
    }
    return h;
  }

  double cell_;
  std::unordered_map<std::uint64_t, std::uint32_t> heads_;
  std::vector<std::uint32_t> next_;
};

double squared(const Vec3& a, const Vec3& b) {
  const Vec3 d = minus(a, b);
  return dot(d, d);
}

class Welder {
 public:
  Welder(std::span<const SurfacePatch> patches, double gap) : patches_(patches), gap_(gap) {}

  SurfaceMesh run() {
    weld_corners();
    VertexGrid grid(gap_);
    for (std::uint32_t v = 0; v < mesh_.vertices.size(); ++v) grid.insert(mesh_.vertices[v], v);
    for (std::size_t i = 0; i < patches_.size(); ++i) add_faces(i, grid);
    finish_colors();
    return std::move(mesh_);
  }

 private:
  [[nodiscard]] double reach(const SurfacePatch& p) const {
    return std::min(gap_, 0.45 * std::sqrt(p.area_m2));
  }

  void weld_corners() {
    VertexGrid grid(gap_);
    std::vector<Vec3> first;  // where clusters began: what is near is decided there, so that none wanders
    std::vector<double> reaches, members;
    for (const SurfacePatch& patch : patches_) {
      std::vector<std::uint32_t> ring;
      for (const Vec3& corner : patch.polygon) {
        std::uint32_t best = kNone;
        double nearest = reach(patch) * reach(patch);
        grid.around(corner, [&](std::uint32_t v) {
          const double d = squared(first[v], corner);
          if (d > nearest || d > reaches[v] * reaches[v] || (d == nearest && v > best)) return;
          nearest = d;
          best = v;
        });
        if (best == kNone) {
          best = static_cast<std::uint32_t>(first.size());
          first.push_back(corner);
          reaches.push_back(reach(patch));
          members.push_back(0);
          mesh_.vertices.push_back({0, 0, 0});
          grid.insert(corner, best);
        }
        for (std::size_t d = 0; d < 3; ++d) mesh_.vertices[best][d] += corner[d] - first[best][d];
        members[best] += 1;
        if (ring.empty() || (ring.back() != best && ring.front() != best)) ring.push_back(best);
      }
      rings_.push_back(std::move(ring));
    }
    for (std::size_t v = 0; v < first.size(); ++v) {
      for (std::size_t d = 0; d < 3; ++d)
        mesh_.vertices[v][d] = first[v][d] + mesh_.vertices[v][d] / members[v];
    }
  }

  struct Between {
    double at;
    std::uint32_t vertex;
    auto operator<=>(const Between&) const = default;
  };

  /// Others' vertices that lie on the edge, in order.
  std::vector<Between> on_edge(std::uint32_t a, std::uint32_t b, const std::vector<std::uint32_t>& ring,
                               double reach_m, const VertexGrid& grid) const {
    const Vec3& from = mesh_.vertices[a];
    const Vec3 d = minus(mesh_.vertices[b], from);
    const double l2 = dot(d, d), length = std::sqrt(l2);
    std::vector<Between> found;
    const auto consider = [&](std::uint32_t v) {
      const Vec3 o = minus(mesh_.vertices[v], from);
      const double t = dot(o, d) / l2;
      if (!(t * length > 0.3 * reach_m) || !((1 - t) * length > 0.3 * reach_m)) return;
      if (dot(o, o) - t * t * l2 > reach_m * reach_m) return;
      if (std::find(ring.begin(), ring.end(), v) == ring.end()) found.push_back({t, v});
    };
    const double steps = std::min(65536.0, std::ceil(length / gap_));
    for (double s = 0; s <= steps && l2 > 0; ++s) {
      const double t = s / steps;
      grid.around({from[0] + t * d[0], from[1] + t * d[1], from[2] + t * d[2]}, consider);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  void add_faces(std::size_t patch, const VertexGrid& grid) {
    const std::vector<std::uint32_t>& ring = rings_[patch];
    if (ring.size() < 3) return;
    std::vector<std::uint32_t> whole;
    for (std::size_t i = 0; i < ring.size(); ++i) {
      whole.push_back(ring[i]);
      for (const Between& x :
           on_edge(ring[i], ring[(i + 1) % ring.size()], ring, reach(patches_[patch]), grid)) {
        if (std::find(whole.begin(), whole.end(), x.vertex) == whole.end()) whole.push_back(x.vertex);
      }
    }
    for (const std::uint32_t v : whole) tint(v, patches_[patch]);
    if (whole.size() == ring.size()) {
      for (std::size_t i = 1; i + 1 < ring.size(); ++i)
        mesh_.faces.push_back({ring[0], ring[i], ring[i + 1]});
      return;
    }
    // Corners in a row make a fan from one of them flat: from the middle instead.
    const auto middle = static_cast<std::uint32_t>(mesh_.vertices.size());
    mesh_.vertices.push_back(patches_[patch].center);
    tint(middle, patches_[patch]);
    for (std::size_t i = 0; i < whole.size(); ++i)
      mesh_.faces.push_back({middle, whole[i], whole[(i + 1) % whole.size()]});
  }

  void tint(std::uint32_t vertex, const SurfacePatch& patch) {
    if (tints_.size() <= vertex) tints_.resize(vertex + 1, {0, 0, 0, 0});
    if (!patch.colored) return;
    for (std::size_t c = 0; c < 3; ++c) tints_[vertex][c] += patch.rgb[c];
    tints_[vertex][3] += 1;
    colored_ = true;
  }

  void finish_colors() {
    if (!colored_) return;
    tints_.resize(mesh_.vertices.size(), {0, 0, 0, 0});
    for (const auto& t : tints_) {
      std::array<std::uint8_t, 3> rgb{};
      for (std::size_t c = 0; c < 3; ++c)
        rgb[c] = static_cast<std::uint8_t>(std::clamp(t[3] > 0 ? t[c] / t[3] + 0.5 : 0.0, 0.0, 255.0));
      mesh_.rgb.push_back(rgb);
    }
  }

  std::span<const SurfacePatch> patches_;
  double gap_;
  SurfaceMesh mesh_;
  std::vector<std::vector<std::uint32_t>> rings_;  // of the patches, in vertices
  std::vector<std::array<double, 4>> tints_;       // sums of colours, and how many
  bool colored_ = false;
};

}  // namespace

SurfaceMesh weld_patches(std::span<const SurfacePatch> patches, double gap_m) {
  return Welder(patches, gap_m).run();
}

}  // namespace mapcodec
