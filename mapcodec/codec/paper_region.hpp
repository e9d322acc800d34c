// SPDX-License-Identifier: GPL-3.0-or-later
// Region growing over a triangle mesh: which edge is looked at next, and which known vertices may lie beyond
// it. Encoder and decoder run the same one, so that connectivity costs little more than a bit per edge.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "mapcodec/codec/paper_mesh.hpp"

namespace mapcodec::paper {

inline constexpr std::uint32_t kNoVertex = ~std::uint32_t{0};

/// An edge with a triangle on its left and nothing yet on its right.
struct Gate {
  std::uint32_t from = 0, to = 0;
  std::uint32_t opposite = 0;  ///< third vertex of the triangle on the left
  std::uint32_t triangle = 0;  ///< that triangle
};

/// Known vertices that would close a gap beside the gate: ends of the open edges that touch it.
struct Candidates {
  std::uint32_t next = kNoVertex;      ///< beyond `to`
  std::uint32_t previous = kNoVertex;  ///< before `from`

  [[nodiscard]] bool any() const { return next != kNoVertex || previous != kNoVertex; }
  [[nodiscard]] bool differ() const { return next != kNoVertex && previous != kNoVertex && next != previous; }
  /// 0 none, 1 next, 2 previous, 3 two different ones, 4 both the same.
  [[nodiscard]] std::size_t context() const {
    if (next != kNoVertex && next == previous) return 4;
    return (next != kNoVertex ? 1u : 0u) + (previous != kNoVertex ? 2u : 0u);
  }
  [[nodiscard]] std::uint32_t only() const { return next != kNoVertex ? next : previous; }
};

/// First in, first out. A set, not a hash table: hostile bytes cannot make it slow.
class RegionGrower {
 public:
  /// The first triangle of a component.
  void seed(const std::array<std::uint32_t, 3>& t, std::uint32_t triangle) {
    gates_.clear();
    head_ = 0;
    forward_.clear();
    backward_.clear();
    for (std::size_t i = 0; i < 3; ++i) join({t[i], t[(i + 1) % 3], t[(i + 2) % 3], triangle});
  }
  /// The triangle to, from, apex beyond `gate`.
  void grow(const Gate& gate, std::uint32_t apex, std::uint32_t triangle) {
    join({gate.from, apex, gate.to, triangle});
    join({apex, gate.to, gate.from, triangle});
  }
  /// Takes the next open edge; false when there is none.
  bool pop(Gate& gate) {
    while (head_ < gates_.size()) {
      gate = gates_[head_++];
      if (forward_.erase(key(gate.from, gate.to)) == 0) continue;
      backward_.erase(key(gate.to, gate.from));
      return true;
    }
    return false;
  }
  [[nodiscard]] Candidates candidates(const Gate& gate, std::span<const LatticeVertex> vertices) const {
    Candidates c{last(forward_, gate.to), last(backward_, gate.from)};
    const auto behind = [&](std::uint32_t apex) {
      return apex == kNoVertex || doubled_area(vertices[gate.to], vertices[gate.from], vertices[apex]) <= 0;
    };
    if (behind(c.next)) c.next = kNoVertex;
    if (behind(c.previous)) c.previous = kNoVertex;
    return c;
  }

 private:
  static std::uint64_t key(std::uint32_t a, std::uint32_t b) { return std::uint64_t{a} << 32 | b; }
  // The youngest vertex that an open edge joins to `a`.
  static std::uint32_t last(const std::set<std::uint64_t>& edges, std::uint32_t a) {
    const auto after = edges.upper_bound(key(a, kNoVertex));
    if (after == edges.begin()) return kNoVertex;
    const std::uint64_t edge = *std::prev(after);
    return edge >> 32 == a ? static_cast<std::uint32_t>(edge) : kNoVertex;
  }
  void join(const Gate& edge) {
    if (forward_.erase(key(edge.to, edge.from)) != 0) {
      backward_.erase(key(edge.from, edge.to));
      return;
    }
    forward_.insert(key(edge.from, edge.to));
    backward_.insert(key(edge.to, edge.from));
    gates_.push_back(edge);
  }

  std::vector<Gate> gates_;
  std::size_t head_ = 0;
  std::set<std::uint64_t> forward_;   ///< from, to of open edges
  std::set<std::uint64_t> backward_;  ///< to, from of the same
};

}  // namespace mapcodec::paper
