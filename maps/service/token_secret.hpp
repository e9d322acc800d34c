// SPDX-License-Identifier: GPL-3.0-or-later
// Secrets of tokens: made here, stored only as hashes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

using TokenHash = std::array<std::uint8_t, 32>;

/// "mct_" and 43 letters, digits, - and _: 256 bits from the kernel. Errors: Unreadable (no random numbers).
[[nodiscard]] Result<std::string> make_token_secret();

/// SHA-256. A secret has 256 random bits, so no salt and no slow hash are needed: nothing can be guessed.
/// Errors: Unsupported (the crypto library refuses SHA-256).
[[nodiscard]] Result<TokenHash> hash_token(std::string_view secret);

}  // namespace mapcodec
