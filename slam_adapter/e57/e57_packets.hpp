// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "slam_adapter/e57/e57_scan.hpp"
#include "slam_adapter/formats/cursor.hpp"

namespace mapcodec {

/// The records of one scan: every field a stream of bits, cut into packets that bring a piece of each.
class E57Packets {
 public:
  /// @param pages  the file without checksums; both must outlive it.
  E57Packets(const ByteStream& pages, const E57Scan& scan);
  /// Finds the first packet. Errors: Truncated, Malformed.
  [[nodiscard]] Status open();
  /// Reads packets until every field has the bits of one more record. Errors: Truncated, Malformed,
  /// LimitExceeded (fields of one record lie more than 64 MiB apart).
  [[nodiscard]] Status prepare();
  /// The raw bits of field `f` in the record that `prepare` made ready; to be taken once each.
  [[nodiscard]] std::uint64_t take(std::size_t f);

 private:
  struct Stream {
    unsigned bits = 0;
    Bytes bytes;
    std::size_t at = 0;  ///< in bits
    [[nodiscard]] bool ready() const { return bytes.size() * 8 - at >= bits; }
  };
  [[nodiscard]] Status read_packet();
  [[nodiscard]] Status read_data(ByteSpan packet, std::uint64_t at);

  Cursor cursor_;
  std::uint64_t section_, end_ = 0;
  std::vector<Stream> streams_;
};

}  // namespace mapcodec
