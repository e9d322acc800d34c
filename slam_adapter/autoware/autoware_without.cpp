// SPDX-License-Identifier: GPL-3.0-or-later
// In place of autoware_metadata.cpp where yaml-cpp is not used.
#include "slam_adapter/autoware/autoware_metadata.hpp"

namespace mapcodec {

Result<AutowareMetadata> parse_autoware_metadata(const std::string&) {
  return make_error(ErrorCode::kUnsupported, "is not read by this build (MAPCODEC_AUTOWARE)");
}

std::string format_autoware_metadata(const AutowareMetadata&) {
  return {};
}

}  // namespace mapcodec
