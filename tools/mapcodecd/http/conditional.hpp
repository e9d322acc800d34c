// SPDX-License-Identifier: GPL-3.0-or-later
// Conditions and ranges of HTTP requests [RFC 9110, 13 and 14].
#pragma once

#include <cstdint>
#include <string_view>

namespace mapcodec::daemon {

/// Whether If-None-Match names the entity tag, which is quoted; weak tags and "*" count.
[[nodiscard]] bool matches_etag(std::string_view if_none_match, std::string_view etag);

struct ByteRange {
  enum class Kind : std::uint8_t { whole, part, unsatisfiable };
  Kind kind = Kind::whole;
  std::uint64_t offset = 0, length = 0;  ///< within the entity
};

/// What a Range header asks of `size` bytes. Several ranges, other units and what is malformed give the
/// whole, as the standard permits: answers with many parts can be made much longer than the entity.
[[nodiscard]] ByteRange parse_range(std::string_view header, std::uint64_t size);

}  // namespace mapcodec::daemon
