// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <optional>
#include <string>

#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {

/// What a record is (its field "op").
enum class BagOp : std::uint8_t {
  message = 0x02,
  bag_header = 0x03,
  index = 0x04,
  chunk = 0x05,
  chunk_info = 0x06,
  connection = 0x07
};

/// The named fields of a record's header, or of a connection's data.
class BagFields {
 public:
  /// @return nothing where the bytes are not fields.
  [[nodiscard]] static std::optional<BagFields> parse(ByteSpan bytes);
  [[nodiscard]] bool has(const std::string& name) const { return values_.count(name) > 0; }
  [[nodiscard]] std::string text(const std::string& name) const;
  /// Little-endian of exactly that width; nothing where it is missing or of another width.
  [[nodiscard]] std::optional<std::uint32_t> u32(const std::string& name) const;
  [[nodiscard]] std::optional<std::uint64_t> u64(const std::string& name) const;
  /// Seconds and nanoseconds [ns].
  [[nodiscard]] std::optional<std::int64_t> time_ns(const std::string& name) const;
  [[nodiscard]] std::optional<BagOp> op() const;

 private:
  std::map<std::string, ByteSpan, std::less<>> values_;  ///< views into what was parsed
};

}  // namespace mapcodec
