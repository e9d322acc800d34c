// SPDX-License-Identifier: GPL-3.0-or-later
// Region growing over a triangle mesh: which edge is looked at next, and which known vertices may lie beyond
// it. Encoder and decoder run the same one, so that connectivity costs little more than a bit per edge.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
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

/// Directed edges between the vertices of one component, by their first vertex. A vertex rarely has more than
/// two at a time: a few are held in place, without an allocation; a set takes what does not fit, so that
/// hostile bytes cannot make it slow.
class OpenEdges {
 public:
  /// @param first  the smallest vertex that will follow.
  void clear(std::uint32_t first) {
    first_ = first;
    slots_.clear();
    rest_.clear();
  }
  void insert(std::uint32_t a, std::uint32_t b) {
    const std::size_t at = a - first_;
    if (at >= slots_.size()) slots_.resize(at + 1);
    Slot& slot = slots_[at];
    if (slot.count < kInPlace) {
      slot.to[slot.count++] = b;
    } else if (rest_.insert(key(a, b)).second) {
      ++slot.elsewhere;
    }
  }
  /// @return whether it was there.
  bool erase(std::uint32_t a, std::uint32_t b) {
    const std::size_t at = a - first_;
    if (at >= slots_.size()) return false;
    Slot& slot = slots_[at];
    for (std::uint32_t i = 0; i < slot.count; ++i) {
      if (slot.to[i] != b) continue;
      slot.to[i] = slot.to[--slot.count];
      return true;
    }
    if (slot.elsewhere == 0 || rest_.erase(key(a, b)) == 0) return false;
    --slot.elsewhere;
    return true;
  }
  [[nodiscard]] bool contains(std::uint32_t a, std::uint32_t b) const {
    const std::size_t at = a - first_;
    if (at >= slots_.size()) return false;
    const Slot& slot = slots_[at];
    for (std::uint32_t i = 0; i < slot.count; ++i) {
      if (slot.to[i] == b) return true;
    }
    return slot.elsewhere > 0 && rest_.contains(key(a, b));
  }
  /// The youngest vertex that an edge from `a` leads to, or kNoVertex.
  [[nodiscard]] std::uint32_t last(std::uint32_t a) const {
    const std::size_t at = a - first_;
    if (at >= slots_.size()) return kNoVertex;
    const Slot& slot = slots_[at];
    std::uint32_t most = slot.count > 0 ? slot.to[0] : kNoVertex;
    for (std::uint32_t i = 1; i < slot.count; ++i) most = slot.to[i] > most ? slot.to[i] : most;
    if (slot.elsewhere == 0) return most;
    const auto other = static_cast<std::uint32_t>(*std::prev(rest_.upper_bound(key(a, kNoVertex))));
    return most == kNoVertex || other > most ? other : most;
  }

 private:
  static constexpr std::uint32_t kInPlace = 4;
  struct Slot {
    std::array<std::uint32_t, kInPlace> to{};
    std::uint32_t count = 0;
    std::uint32_t elsewhere = 0;  ///< more of this vertex in rest_
  };
  static std::uint64_t key(std::uint32_t a, std::uint32_t b) { return std::uint64_t{a} << 32 | b; }

  std::uint32_t first_ = 0;
  std::vector<Slot> slots_;  ///< by vertex, from first_
  std::set<std::uint64_t> rest_;
};

/// First in, first out.
class RegionGrower {
 public:
  /// The first triangle of a component.
  void seed(const std::array<std::uint32_t, 3>& t, std::uint32_t triangle) {
    gates_.clear();
    head_ = 0;
    const std::uint32_t first = std::min({t[0], t[1], t[2]});
    forward_.clear(first);
    backward_.clear(first);
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
      if (!forward_.erase(gate.from, gate.to)) continue;
      backward_.erase(gate.to, gate.from);
      return true;
    }
    return false;
  }
  [[nodiscard]] Candidates candidates(const Gate& gate, std::span<const LatticeVertex> vertices) const {
    Candidates c{forward_.last(gate.to), backward_.last(gate.from)};
    const auto behind = [&](std::uint32_t apex) {
      return apex == kNoVertex || doubled_area(vertices[gate.to], vertices[gate.from], vertices[apex]) <= 0;
    };
    if (behind(c.next)) c.next = kNoVertex;
    if (behind(c.previous)) c.previous = kNoVertex;
    return c;
  }

 private:
  void join(const Gate& edge) {
    if (forward_.erase(edge.to, edge.from)) {
      backward_.erase(edge.from, edge.to);
      return;
    }
    // Damaged bytes may open an edge twice; it is one edge all the same.
    if (!forward_.contains(edge.from, edge.to)) {
      forward_.insert(edge.from, edge.to);
      backward_.insert(edge.to, edge.from);
    }
    gates_.push_back(edge);
  }

  std::vector<Gate> gates_;
  std::size_t head_ = 0;
  OpenEdges forward_;   ///< from, to
  OpenEdges backward_;  ///< to, from of the same
};

}  // namespace mapcodec::paper
