// SPDX-License-Identifier: GPL-3.0-or-later
// The surface beneath an archive, small enough for a file, memory, or immutable objects with one
// compare-and-set.
#pragma once

#include <atomic>
#include <memory>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"

namespace mapcodec {

/// Immutable bytes under ascending addresses, and heads that make them count. What was appended after the
/// last head does not exist for a reader. Threads: const methods from many at once; the others from one
/// thread.
class TileStore {
 public:
  virtual ~TileStore() = default;

  /// Stores `bytes` at the current end. They are durable only after `publish`.
  /// Errors: CannotWrite (then for good: nothing more can be written).
  [[nodiscard]] virtual Result<SegmentRef> append(ByteSpan bytes) = 0;
  /// Appends `head`, makes it and everything before it durable, and visible to new readers, in one step.
  /// Errors: CannotWrite (then for good).
  [[nodiscard]] virtual Status publish(ByteSpan head) = 0;
  /// Forgets everything from `end` on: the remains of an unfinished commit. Errors: CannotWrite.
  [[nodiscard]] virtual Status discard_after(std::uint64_t end) = 0;

  /// The `length` bytes at `offset`. Errors: Truncated (beyond the end), Unreadable.
  [[nodiscard]] virtual Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const = 0;
  /// Address after the last byte. Errors: Unreadable.
  [[nodiscard]] virtual Result<std::uint64_t> end() const = 0;
  /// Bytes read so far.
  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
};

/// A store in memory, for tests, fuzzing, and archives that came over a network.
class MemoryStore final : public TileStore {
 public:
  explicit MemoryStore(Bytes bytes = {}) : bytes_(std::move(bytes)) {}

  [[nodiscard]] Result<SegmentRef> append(ByteSpan bytes) override;
  [[nodiscard]] Status publish(ByteSpan head) override;
  [[nodiscard]] Status discard_after(std::uint64_t end) override;
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const override;
  [[nodiscard]] Result<std::uint64_t> end() const override { return std::uint64_t{bytes_.size()}; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return bytes_read_; }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

 private:
  Bytes bytes_;
  mutable std::atomic<std::uint64_t> bytes_read_{0};
};

}  // namespace mapcodec
