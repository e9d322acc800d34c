// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/segment_cache.hpp"

namespace mapcodec {

SegmentCache::Value SegmentCache::find(const Key& key) {
  const std::lock_guard lock(mutex_);
  const auto at = entries_.find(key);
  if (at == entries_.end()) {
    ++misses_;
    return nullptr;
  }
  ++hits_;
  by_use_.splice(by_use_.begin(), by_use_, at->second);
  return at->second->value;
}

void SegmentCache::put(const Key& key, Value value) {
  if (value->size() > limit_ / 8) return;
  const std::lock_guard lock(mutex_);
  if (entries_.contains(key)) return;
  bytes_ += value->size();
  by_use_.push_front({key, std::move(value)});
  entries_[key] = by_use_.begin();
  while (bytes_ > limit_) {
    const Entry& oldest = by_use_.back();
    bytes_ -= oldest.value->size();
    entries_.erase(oldest.key);
    by_use_.pop_back();
  }
}

}  // namespace mapcodec
