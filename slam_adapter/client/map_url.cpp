// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/map_url.hpp"

#include <string_view>

namespace mapcodec {

bool is_map_url(const std::string& text) {
  return text.rfind(kMapScheme, 0) == 0;
}

Result<MapUrl> parse_map_url(const std::string& text) {
  const std::string rest =
      is_map_url(text) ? text.substr(std::string_view(kMapScheme).size()) : std::string();
  const bool socket = rest.rfind("unix:/", 0) == 0;
  const auto slash = socket ? rest.rfind('/') : rest.find('/');
  MapUrl url;
  url.address = rest.substr(0, slash);
  if (slash != std::string::npos) url.map = rest.substr(slash + 1);
  const auto colon = url.address.rfind(':');
  const bool has_port = colon != std::string::npos && colon + 1 < url.address.size() && colon > 0;
  if (!has_port || url.map.find('/') != std::string::npos)
    return make_error(ErrorCode::kInvalidArgument, "'" + text + "' is not mapcodec://HOST:PORT/MAP");
  return url;
}

}  // namespace mapcodec
