// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/tokens.hpp"

#include <cctype>

namespace mapcodec {

std::optional<Right> parse_right(std::string_view word) {
  for (const Right right : {Right::read, Right::write, Right::admin}) {
    if (word == right_name(right)) return right;
  }
  return std::nullopt;
}

Error refusal(TokenState state) {
  switch (state) {
    case TokenState::unknown:
      return make_error(ErrorCode::kUnauthenticated, "the bearer token is not known");
    case TokenState::expired:
      return make_error(ErrorCode::kUnauthenticated, "the bearer token has expired");
    case TokenState::forbidden:
      return make_error(ErrorCode::kDenied, "the bearer token does not give this right to this map");
    case TokenState::missing:
    case TokenState::granted:
      break;
  }
  return make_error(ErrorCode::kUnauthenticated, "a bearer token is needed");
}

std::string_view bearer_token(std::string_view authorization) {
  constexpr std::string_view kScheme = "bearer ";
  if (authorization.size() <= kScheme.size()) return {};
  for (std::size_t i = 0; i < kScheme.size(); ++i) {
    if (std::tolower(static_cast<unsigned char>(authorization[i])) != kScheme[i]) return {};
  }
  authorization.remove_prefix(kScheme.size());
  const std::size_t first = authorization.find_first_not_of(' ');
  return first == authorization.npos ? std::string_view{} : authorization.substr(first);
}

}  // namespace mapcodec
