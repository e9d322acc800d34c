// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdlib>

#include "slam_adapter/formats/formats.hpp"

namespace mapcodec {

/// Reads all of `source` twice; both times must end alike, and every block must be what the layout says.
inline void drain(PointSource& source) {
  constexpr std::uint64_t kEnough = 2'000'000;  // compressed PCD may hold many points per byte
  std::uint64_t counts[2] = {0, 0};
  for (std::uint64_t& count : counts) {
    PointCloud block;
    for (;;) {
      const auto more = source.next(block);
      if (!more.ok() || !*more || count > kEnough) break;
      if (block.empty() || block.size() > 65536 || block.channels.size() != source.layout().channels.size())
        std::abort();
      for (const Channel& c : block.channels) {
        if (c.data.size() != block.size() * c.info.stride()) std::abort();
      }
      count += block.size();
    }
    if (source.warnings().size() > 1000) std::abort();
    if (!source.rewind().ok()) std::abort();
  }
  if (counts[0] != counts[1]) std::abort();
}

inline int fuzz_bytes(const std::uint8_t* data, std::size_t size, const char* name) {
  auto source = open_source_memory(ByteSpan(data, size), name);
  if (source.ok()) drain(**source);
  return 0;
}

}  // namespace mapcodec
