// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

/// CRC-32C (Castagnoli, reflected polynomial 0x82F63B78) of `bytes`; `seed` is the CRC of what came before.
[[nodiscard]] std::uint32_t crc32c(ByteSpan bytes, std::uint32_t seed = 0);

}  // namespace mapcodec
