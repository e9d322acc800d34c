// SPDX-License-Identifier: GPL-3.0-or-later
// The metadata of a map folder.
#include <cstdlib>
#include <string>

#include "slam_adapter/autoware/autoware_metadata.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  const auto metadata = parse_autoware_metadata(std::string(reinterpret_cast<const char*>(data), size));
  if (!metadata.ok()) return 0;
  if (metadata->tiles.empty()) std::abort();
  (void)format_autoware_metadata(*metadata);
  return 0;
}
