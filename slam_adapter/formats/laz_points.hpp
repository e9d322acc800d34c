// SPDX-License-Identifier: GPL-3.0-or-later
// The point coders of LAZ: pointwise (point formats 0 to 3) and layered (6 to 8).
#pragma once

#include <memory>
#include <vector>

#include "slam_adapter/formats/laz_bits.hpp"

namespace mapcodec {

/// What LASzip's record in the header calls an item: a part of the point record with a coder of its own.
enum class LazItemType : std::uint16_t {
  bytes = 0,
  point10 = 6,
  gps_time = 7,
  rgb = 8,
  point14 = 10,
  rgb14 = 11,
  rgb_nir14 = 12,
  bytes14 = 14
};
struct LazItem {
  LazItemType type = LazItemType::bytes;
  std::uint16_t size = 0, version = 0;
};

/// The points of one chunk, in order, as uncompressed records of LAS.
class LazChunk {
 public:
  virtual ~LazChunk() = default;
  /// Writes one record to `row`. False once the bytes have run out.
  [[nodiscard]] virtual bool next(std::uint8_t* row) = 0;
  /// Points that the chunk itself says it has; 0 if it does not say.
  [[nodiscard]] virtual std::uint64_t points() const { return 0; }
};

/// The first record stands raw before the coded ones. @param stream  must outlive the chunk.
/// Errors: Truncated, Unsupported (items).
[[nodiscard]] Result<std::unique_ptr<LazChunk>> open_pointwise_chunk(const std::vector<LazItem>& items,
                                                                     const ByteStream& stream,
                                                                     std::uint64_t begin, std::uint64_t end);
/// Each attribute is a stream of its own; streams that are empty mean that it never changes.
[[nodiscard]] Result<std::unique_ptr<LazChunk>> open_layered_chunk(const std::vector<LazItem>& items,
                                                                   const ByteStream& stream,
                                                                   std::uint64_t begin, std::uint64_t end);
/// Whether the item belongs to the layered generation.
[[nodiscard]] inline bool is_layered(LazItemType type) {
  return static_cast<std::uint16_t>(type) >= 10;
}

}  // namespace mapcodec
