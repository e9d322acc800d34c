// SPDX-License-Identifier: GPL-3.0-or-later
// What an encoder remembers of a tile between codings of it. Encoder only.
#pragma once

#include <cstdint>
#include <memory>

namespace mapcodec {

/// Positions of one tile as the `surface` codec coded them, and what it found out of its colours: coding the
/// tile again with other colours takes a fraction of the time, and gives the bytes that coding it anew would.
/// For one tile whose points and channels stay as they are. Threads: one at a time.
class TileMemo {
 public:
  TileMemo();
  TileMemo(TileMemo&&) noexcept;
  TileMemo& operator=(TileMemo&&) noexcept;
  ~TileMemo();

  [[nodiscard]] bool empty() const { return content == nullptr; }
  /// Held in memory, about.
  [[nodiscard]] std::uint64_t bytes() const;
  /// Of `points` points with channels, at most, about: to know it before.
  [[nodiscard]] static std::uint64_t bytes_for(std::uint64_t points);

  struct Content;
  std::unique_ptr<Content> content;  ///< the encoder's own
};

}  // namespace mapcodec
