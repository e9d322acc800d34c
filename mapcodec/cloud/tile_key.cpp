// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {
namespace {

/// The axis whose highest differing bit is highest decides (Chan 2002): no interleaving, no width limit.
bool less_msb(std::uint64_t a, std::uint64_t b) {
  return a < b && a < (a ^ b);
}

std::uint64_t corner(std::int32_t v, std::uint8_t level) {
  // Offset binary, so that negative coordinates sort below positive ones.
  return static_cast<std::uint64_t>((static_cast<std::int64_t>(v) << level)) + (std::uint64_t{1} << 62);
}

}  // namespace

std::strong_ordering compare_morton(const TileKey& a, const TileKey& b) {
  if (a.is_unplaced() || b.is_unplaced()) return a.is_unplaced() <=> b.is_unplaced();
  const std::uint64_t pa[3] = {corner(a.z, a.level), corner(a.y, a.level), corner(a.x, a.level)};
  const std::uint64_t pb[3] = {corner(b.z, b.level), corner(b.y, b.level), corner(b.x, b.level)};
  std::uint64_t top = 0;
  int axis = 0;
  for (int d = 0; d < 3; ++d) {
    if (less_msb(top, pa[d] ^ pb[d])) {
      top = pa[d] ^ pb[d];
      axis = d;
    }
  }
  if (pa[axis] != pb[axis]) return pa[axis] <=> pb[axis];
  return b.level <=> a.level;
}

}  // namespace mapcodec
