// SPDX-License-Identifier: GPL-3.0-or-later
// Where a map of a service is: mapcodec://HOST:PORT/MAP, or mapcodec://unix:/PATH/OF/SOCKET/MAP.
#pragma once

#include <string>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

inline constexpr const char* kMapScheme = "mapcodec://";

struct MapUrl {
  std::string address;  ///< "HOST:PORT", "unix:/PATH"
  std::string map;      ///< empty: the service as a whole
};

[[nodiscard]] bool is_map_url(const std::string& text);
/// Errors: InvalidArgument.
[[nodiscard]] Result<MapUrl> parse_map_url(const std::string& text);

}  // namespace mapcodec
