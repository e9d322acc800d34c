// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "mapcodec/cloud/vec3.hpp"

namespace mapcodec {

/// Where a tile ends and the map goes on.
struct TileBorders {
  Box cube;                   ///< of the tile [m, map frame]
  std::uint8_t occupied = 0;  ///< bit 2 axis, + 1 for the upper side: other tiles lie beyond that face

  [[nodiscard]] constexpr bool goes_on(unsigned axis, bool upper) const {
    return (occupied >> (2 * axis + (upper ? 1 : 0)) & 1) != 0;
  }
};

}  // namespace mapcodec
