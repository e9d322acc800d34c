// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string_view>

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

/// Reads a ByteStream forwards through a buffer, by bytes or by lines. Several cursors may share a stream.
class Cursor {
 public:
  static constexpr std::size_t kMaxLine = std::size_t{1} << 20;

  explicit Cursor(const ByteStream& stream) : stream_(&stream) {}

  /// Byte offset of what comes next.
  [[nodiscard]] std::uint64_t offset() const { return at_ - (end_ - begin_); }
  [[nodiscard]] std::uint64_t left() const {
    return stream_->size() > offset() ? stream_->size() - offset() : 0;
  }
  /// 1 for the first line; the line that `line` returned last.
  [[nodiscard]] std::uint64_t line_number() const { return line_number_; }

  /// Goes to `offset`, of which the caller knows that `lines` lines lie before it.
  void seek(std::uint64_t offset, std::uint64_t lines = 0);
  /// Passes `count` bytes without looking at them.
  void skip(std::uint64_t count) { seek(offset() + count, line_number_); }
  /// The next `count` bytes, fewer at the end; valid until the next call.
  ByteSpan take(std::size_t count);
  /// The next line without its end (LF or CRLF), valid until the next call; false at the end or on failure.
  bool line(std::string_view& out);
  /// The next line that is neither blank nor, if `comments`, begins with # or //.
  bool content_line(std::string_view& out, bool comments);
  /// The first read error or over-long line, which also ends the input.
  [[nodiscard]] const Status& status() const { return status_; }

 private:
  bool fill(std::size_t wanted);
  bool accept_line(std::size_t length, std::size_t used, std::string_view& out);

  const ByteStream* stream_;
  Bytes buffer_;
  std::size_t begin_ = 0, end_ = 0;
  std::uint64_t at_ = 0;  ///< stream offset of buffer_[end_]
  std::uint64_t line_number_ = 0;
  Status status_;
};

}  // namespace mapcodec
