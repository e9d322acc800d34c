// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/coding_memory.hpp"

#include "parallel/encode_pipeline.hpp"

namespace mapcodec {

void CodingMemory::begin(std::uint64_t budget_bytes) {
  const std::lock_guard lock(mutex_);
  entries_.clear();
  left_ = budget_bytes;
}

/// Nothing where memory is used up.
CodingMemory::Entry* CodingMemory::entry_for(const TileKey& key, std::uint64_t points) {
  const std::lock_guard lock(mutex_);
  const auto known = entries_.find(key);
  if (known != entries_.end()) return &known->second;
  const std::uint64_t bytes = TileMemo::bytes_for(points);
  if (bytes > left_) return nullptr;
  left_ -= bytes;
  return &entries_[key];
}

Result<EncodedTile> CodingMemory::encode(const TileKey& key, const PointCloud& tile, const MapSchema& schema,
                                         const CodingPlan& plan) {
  Entry* entry = entry_for(key, tile.size());
  if (entry == nullptr) return encode_by_plan(tile, schema, plan);
  const Bytes for_schema = write_schema(schema);
  if (entry->points && entry->schema == for_schema) {
    entry->saved = entry->seconds;
    return *entry->points;
  }
  const bool known = !entry->memo.empty();
  const double since = thread_seconds();
  MAPCODEC_ASSIGN(EncodedTile coded, encode_by_plan(tile, schema, plan, &entry->memo));
  if (!known) entry->seconds = thread_seconds() - since;
  entry->saved = known ? entry->seconds : 0;
  if (coded.codec != CodecId::surface) {
    entry->memo = {};  // surfaces were tried, and lost
    entry->points = coded;
    entry->schema = for_schema;
  }
  return coded;
}

double CodingMemory::seconds_saved(const TileKey& key) const {
  const std::lock_guard lock(mutex_);
  const auto known = entries_.find(key);
  return known == entries_.end() ? 0 : known->second.saved;
}

}  // namespace mapcodec
