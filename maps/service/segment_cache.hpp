// SPDX-License-Identifier: GPL-3.0-or-later
// Segments of tiles that were read lately, within a budget of bytes.
#pragma once

#include <atomic>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

/// The least recently used goes first. Threads: from many at once.
class SegmentCache {
 public:
  using Value = std::shared_ptr<const Bytes>;
  /// Segments are immutable: a file and an offset name one for good.
  struct Key {
    std::uint64_t file = 0, offset = 0;
    bool operator==(const Key&) const = default;
  };

  explicit SegmentCache(std::uint64_t limit_bytes) : limit_(limit_bytes) {}

  /// nullptr: not here.
  [[nodiscard]] Value find(const Key& key);
  /// What is larger than an eighth of the budget is not kept.
  void put(const Key& key, Value value);

  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] std::uint64_t limit() const { return limit_; }
  [[nodiscard]] std::uint64_t hits() const { return hits_; }
  [[nodiscard]] std::uint64_t misses() const { return misses_; }

 private:
  struct Hash {
    std::size_t operator()(const Key& k) const {
      return std::hash<std::uint64_t>()(k.file * 0x9E3779B97F4A7C15u ^ k.offset);
    }
  };
  struct Entry {
    Key key;
    Value value;
  };

  const std::uint64_t limit_;
  std::mutex mutex_;
  std::list<Entry> by_use_;  // the newest first
  std::unordered_map<Key, std::list<Entry>::iterator, Hash> entries_;
  std::atomic<std::uint64_t> bytes_{0}, hits_{0}, misses_{0};
};

}  // namespace mapcodec
