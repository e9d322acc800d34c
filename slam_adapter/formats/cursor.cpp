// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/cursor.hpp"

#include <algorithm>
#include <cstring>

namespace mapcodec {

void Cursor::seek(std::uint64_t offset, std::uint64_t lines) {
  const std::uint64_t first = at_ - end_;
  if (offset >= first + begin_ && offset <= at_) {
    begin_ = static_cast<std::size_t>(offset - first);
  } else {
    begin_ = end_ = 0;
    at_ = offset;
  }
  line_number_ = lines;
}

/// Makes `wanted` bytes available if the stream has them.
bool Cursor::fill(std::size_t wanted) {
  constexpr std::size_t kChunk = std::size_t{1} << 18;
  if (end_ - begin_ >= wanted) return true;
  if (begin_ > 0) std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  // The stream's size bounds the buffer: nobody's count does.
  const std::uint64_t rest = stream_->size() > at_ ? stream_->size() - at_ : 0;
  const std::size_t room =
      static_cast<std::size_t>(std::min<std::uint64_t>(std::max(wanted, kChunk), end_ + rest));
  if (buffer_.size() < room) buffer_.resize(room);
  if (room > end_ && status_.ok()) {
    auto got = stream_->read_at(at_, buffer_.data() + end_, room - end_);
    if (!got.ok()) status_ = got.error();
    const std::size_t n = got.ok() ? *got : 0;
    end_ += n;
    at_ += n;
  }
  return end_ - begin_ >= wanted;
}

ByteSpan Cursor::take(std::size_t count) {
  fill(count);
  const ByteSpan r(buffer_.data() + begin_, std::min(count, end_ - begin_));
  begin_ += r.size();
  return r;
}

bool Cursor::accept_line(std::size_t length, std::size_t used, std::string_view& out) {
  out = {reinterpret_cast<const char*>(buffer_.data()) + begin_, length};
  if (!out.empty() && out.back() == '\r') out.remove_suffix(1);
  begin_ += used;
  ++line_number_;
  return true;
}

bool Cursor::line(std::string_view& out) {
  for (std::size_t seen = 0;;) {
    const void* found = end_ - begin_ > seen
                            ? std::memchr(buffer_.data() + begin_ + seen, '\n', end_ - begin_ - seen)
                            : nullptr;
    if (found != nullptr) {
      const auto length =
          static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - (buffer_.data() + begin_));
      return accept_line(length, length + 1, out);
    }
    seen = end_ - begin_;
    if (seen > kMaxLine) {
      status_ = make_error(ErrorCode::kMalformed,
                           "line " + std::to_string(line_number_ + 1) + " is longer than 1 MiB", offset());
      return false;
    }
    if (!fill(seen + 1)) return status_.ok() && seen > 0 && accept_line(seen, seen, out);
  }
}

bool Cursor::content_line(std::string_view& out, bool comments) {
  while (line(out)) {
    const std::size_t first = out.find_first_not_of(" \t");
    if (first == std::string_view::npos) continue;
    const std::string_view rest = out.substr(first);
    if (!comments || !(rest.starts_with('#') || rest.starts_with("//"))) return true;
  }
  return false;
}

}  // namespace mapcodec
