// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>

namespace mapcodec {

/// How far a long piece of work is.
struct Progress {
  const char* phase = "";       ///< "survey", "tiling", "encode" or "decode"; static storage
  std::uint64_t done = 0;       ///< points (tiles while decoding)
  std::uint64_t total = 0;      ///< same unit; 0 where nobody knows
  std::uint64_t bytes_out = 0;  ///< payload bytes handed on so far
};

/// Called now and then, by one thread at a time but not always by the same; must return soon and not throw.
using ProgressCallback = std::function<void(const Progress&)>;

}  // namespace mapcodec
