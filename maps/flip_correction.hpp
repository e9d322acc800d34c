// SPDX-License-Identifier: GPL-3.0-or-later
// A CRC tells where a single wrong byte stands, if it is the only one.
#pragma once

#include <optional>
#include <vector>

#include "maps/commit_record.hpp"

namespace mapcodec {

/// Adding `flip` (XOR) to the byte at `offset` makes it right.
struct Correction {
  std::uint64_t offset = 0;
  std::uint8_t flip = 0;
};

/// The one byte of `message` that explains why its CRC-32C is `actual` and not `stored`; nothing if there is
/// none. A message of n bytes with other damage is taken for one with a single wrong byte with probability
/// 255 n / 2^32: check the result. Pure, O(n).
[[nodiscard]] std::optional<Correction> locate_flip(std::uint32_t actual, std::uint32_t stored,
                                                    std::uint64_t length);

/// What makes a whole commit of the record at `offset`, if a single byte of the record or of its blocks is
/// wrong.
[[nodiscard]] std::optional<Correction> correct_commit(const TileStore& store, std::uint64_t offset);

/// A store as it would be without its wrong bytes. For reading only.
class CorrectedStore final : public TileStore {
 public:
  explicit CorrectedStore(const TileStore& store) : store_(store) {}
  void add(const Correction& correction) { corrections_.push_back(correction); }
  void replace_corrections(const CorrectedStore& other) { corrections_ = other.corrections_; }

  [[nodiscard]] Result<SegmentRef> append(ByteSpan) override { return refused(); }
  [[nodiscard]] Status publish(ByteSpan) override { return refused(); }
  [[nodiscard]] Status discard_after(std::uint64_t) override { return refused(); }
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const override;
  [[nodiscard]] Result<std::uint64_t> end() const override { return store_.end(); }
  [[nodiscard]] std::uint64_t bytes_read() const override { return store_.bytes_read(); }

 private:
  static Error refused() { return make_error(ErrorCode::kCannotWrite, "is open for reading only"); }

  const TileStore& store_;
  std::vector<Correction> corrections_;
};

}  // namespace mapcodec
