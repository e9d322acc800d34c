// SPDX-License-Identifier: GPL-3.0-or-later
// What tokens give, and why one is refused.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "maps/service/access.hpp"

namespace mapcodec {

inline constexpr std::string_view kEveryMap = "*";  ///< in the place of a map's name in a grant

/// One map, or every map.
struct MapGrant {
  std::string map;
  Right right = Right::read;
  bool operator==(const MapGrant&) const = default;
};

/// Why a token may or may not.
enum class TokenState : std::uint8_t {
  granted,
  missing,  ///< none was shown
  unknown,  ///< never given out, or revoked
  expired,
  forbidden,  ///< good, but not for this map or not for this right
};

struct TokenDecision {
  TokenState state = TokenState::missing;
  std::string token;  ///< name of the token where it is known
  [[nodiscard]] bool granted() const { return state == TokenState::granted; }
};

/// Nothing for any other word than those of right_name.
[[nodiscard]] std::optional<Right> parse_right(std::string_view word);

/// Unauthenticated or Denied, in one sentence for the client that does not tell which tokens exist.
[[nodiscard]] Error refusal(TokenState state);

/// The token in the value of an Authorization header or of the metadata key "authorization": "Bearer TOKEN".
/// Empty for anything else.
[[nodiscard]] std::string_view bearer_token(std::string_view authorization);

}  // namespace mapcodec
