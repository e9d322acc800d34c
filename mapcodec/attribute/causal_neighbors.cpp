// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/causal_neighbors.hpp"

#include <algorithm>
#include <bit>

#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kProbes = 16;  // beyond it a cell is not found: keeps crafted collisions harmless
constexpr std::uint32_t kOwnCellPoints = 8;
constexpr std::uint32_t kCellPoints = 3;

std::uint64_t pack(const VoxelCoord& c) {
  return std::uint64_t{c[0]} | (std::uint64_t{c[1]} << 21) | (std::uint64_t{c[2]} << 42);
}

std::size_t hash_of(std::uint64_t key) {
  key *= 0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(key ^ (key >> 29)) * 0xbf58476du >> 7;
}

}  // namespace

CausalNeighbors::CausalNeighbors(std::span<const VoxelCoord> voxels) : voxels_(voxels) {
  choose_cell_size();
}

void CausalNeighbors::choose_cell_size() {
  // cells_at[s]: how many neighbouring pairs lie in different cells of 2^s voxels.
  std::array<std::size_t, kMortonBits + 1> splits{};
  for (std::size_t i = 1; i < voxels_.size(); ++i) {
    const VoxelCoord &a = voxels_[i - 1], &b = voxels_[i];
    const std::uint32_t differ = (a[0] ^ b[0]) | (a[1] ^ b[1]) | (a[2] ^ b[2]);
    ++splits[std::min<std::size_t>(static_cast<std::size_t>(std::bit_width(differ)), kMortonBits)];
  }
  std::size_t cells = 1;
  for (std::size_t s = kMortonBits; s > 0; --s) {
    if (2 * (cells + splits[s]) > voxels_.size()) {
      shift_ = static_cast<std::uint32_t>(s);
      break;
    }
    cells += splits[s];
  }
  mask_ = std::bit_ceil(2 * cells + 2) - 1;
  table_.resize(mask_ + 1);
  cell_begin_.reserve(cells);
}

VoxelCoord CausalNeighbors::cell_of(std::uint32_t i) const {
  const VoxelCoord& v = voxels_[i];
  return {v[0] >> shift_, v[1] >> shift_, v[2] >> shift_};
}

void CausalNeighbors::insert(std::uint64_t key, std::uint32_t cell) {
  std::size_t at = hash_of(key) & mask_;
  for (std::size_t n = 0; n < kProbes; ++n, at = (at + 1) & mask_) {
    if (table_[at].cell == 0) {
      table_[at] = {key, cell + 1};
      return;
    }
  }
}

std::uint32_t CausalNeighbors::look_up(std::uint64_t key) const {
  std::size_t at = hash_of(key) & mask_;
  for (std::size_t n = 0; n < kProbes && table_[at].cell != 0; ++n, at = (at + 1) & mask_) {
    if (table_[at].key == key) return table_[at].cell;
  }
  return 0;
}

void CausalNeighbors::add_candidates(std::uint32_t cell) {
  const std::uint32_t begin = cell_begin_[cell], end = cell_begin_[cell + 1];
  const std::uint32_t count = end - begin;
  const std::uint32_t take = std::min(count, kCellPoints);
  for (std::uint32_t k = 0; k < take; ++k) {
    candidates_[candidate_count_++] =
        begin + static_cast<std::uint32_t>(std::uint64_t{count} * (2 * k + 1) / (2 * take));
  }
}

void CausalNeighbors::begin_cell(std::uint32_t i) {
  const VoxelCoord c = cell_of(i);
  cell_begin_.push_back(i);
  candidate_count_ = 0;
  for (std::uint32_t n = 0; n < 27; ++n) {
    const VoxelCoord to{c[0] + n % 3 - 1, c[1] + n / 3 % 3 - 1, c[2] + n / 9 - 1};
    // Below zero wraps around to above 2^21, where no cell is.
    if (n == 13 || ((to[0] | to[1] | to[2]) >> kMortonBits) != 0) continue;
    if (const std::uint32_t found = look_up(pack(to)); found != 0) add_candidates(found - 1);
  }
  insert(pack(c), static_cast<std::uint32_t>(cell_begin_.size() - 1));
}

void CausalNeighbors::offer(std::uint32_t i, std::uint32_t candidate) {
  std::uint64_t d = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto off =
        static_cast<std::int64_t>(voxels_[i][a]) - static_cast<std::int64_t>(voxels_[candidate][a]);
    d += static_cast<std::uint64_t>(off * off);
  }
  if (found_count_ == kMost && d >= found_[kMost - 1].squared_distance) return;
  std::size_t at = found_count_ < kMost ? found_count_++ : kMost - 1;
  for (; at > 0 && found_[at - 1].squared_distance > d; --at) found_[at] = found_[at - 1];
  found_[at] = {candidate, d};
}

std::span<const CausalNeighbors::Neighbor> CausalNeighbors::find(std::uint32_t i) {
  if (i == 0 || cell_of(i) != cell_of(i - 1)) begin_cell(i);
  found_count_ = 0;
  const std::uint32_t begin = cell_begin_.back();
  const std::uint32_t own = i - std::min(i - begin, kOwnCellPoints);
  for (std::uint32_t j = i; j > own; --j) offer(i, j - 1);
  for (std::size_t k = 0; k < candidate_count_; ++k) offer(i, candidates_[k]);
  if (own == i && i > 0 && found_count_ < kMost) {
    // The predecessor may be in a neighbouring cell, and then it is a candidate already.
    const bool known = std::any_of(found_.begin(), found_.begin() + static_cast<std::ptrdiff_t>(found_count_),
                                   [&](const Neighbor& n) { return n.index == i - 1; });
    if (!known) offer(i, i - 1);
  }
  return {found_.data(), found_count_};
}

}  // namespace mapcodec
