// SPDX-License-Identifier: GPL-3.0-or-later
// Random access to bytes, wherever they lie: so that every reader can be fed from memory.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

class ByteStream {
 public:
  virtual ~ByteStream() = default;
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// Reads up to `count` bytes at `offset`; fewer only at the end. Errors: Unreadable.
  virtual Result<std::size_t> read_at(std::uint64_t offset, std::uint8_t* to, std::size_t count) const = 0;
};

/// `bytes` must outlive the stream.
[[nodiscard]] std::unique_ptr<ByteStream> memory_stream(ByteSpan bytes);
/// Errors (the message does not name the path): NotFound, Unreadable (directory, device, permission).
[[nodiscard]] Result<std::unique_ptr<ByteStream>> file_stream(const std::string& path);

}  // namespace mapcodec
