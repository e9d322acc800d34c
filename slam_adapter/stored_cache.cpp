// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/stored_cache.hpp"

#include <algorithm>

namespace mapcodec {

std::shared_ptr<StoredPoints> StoredCache::find(const TilePlace& place) const {
  const auto at = tiles_.find(place);
  return at == tiles_.end() ? nullptr : at->second.points;
}

void StoredCache::keep(const TilePlace& place, std::shared_ptr<StoredPoints> points) {
  tiles_[place] = {std::move(points), batch_};
}

void StoredCache::trim(std::uint64_t budget_bytes) {
  std::uint64_t bytes = 0;
  std::vector<std::pair<std::uint64_t, TilePlace>> by_age;
  for (const auto& [place, known] : tiles_) {
    bytes += known.points->bytes();
    by_age.emplace_back(known.used, place);
  }
  if (bytes <= budget_bytes) return;
  std::stable_sort(by_age.begin(), by_age.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [used, place] : by_age) {
    if (bytes <= budget_bytes) break;
    const auto at = tiles_.find(place);
    bytes -= at->second.points->bytes();
    tiles_.erase(at);
  }
}

}  // namespace mapcodec
