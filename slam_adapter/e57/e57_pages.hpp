// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

/// The file without the checksums that end each of its pages of 1,024 bytes, which are checked on the way.
/// Offsets are logical: as if the checksums were not there. Threads: one at a time.
class E57Pages final : public ByteStream {
 public:
  static constexpr std::uint64_t kPage = 1024, kPayload = 1020;

  /// @param file  must outlive it.
  explicit E57Pages(const ByteStream& file) : file_(file) {}

  [[nodiscard]] std::uint64_t size() const override { return file_.size() / kPage * kPayload; }
  /// Errors: also Malformed (a checksum), with the page's byte in the file.
  Result<std::size_t> read_at(std::uint64_t offset, std::uint8_t* to, std::size_t count) const override;

  /// Of an offset in the file; one within a checksum becomes the next page's first byte.
  [[nodiscard]] static std::uint64_t logical(std::uint64_t physical) {
    const std::uint64_t in_page = physical % kPage;
    return physical / kPage * kPayload + (in_page < kPayload ? in_page : kPayload);
  }

 private:
  [[nodiscard]] Status load(std::uint64_t page) const;

  const ByteStream& file_;
  mutable Bytes page_;
  mutable std::uint64_t loaded_ = UINT64_MAX;
};

}  // namespace mapcodec
