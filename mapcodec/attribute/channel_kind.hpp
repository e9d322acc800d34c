// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace mapcodec {

/// First byte of a channel's section.
inline constexpr std::uint8_t kColorSection = 0;
inline constexpr std::uint8_t kValuesSection = 1;

}  // namespace mapcodec
