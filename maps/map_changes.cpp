// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/map_changes.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

std::uint64_t segment_bytes(const TileRecord& tile) {
  std::uint64_t sum = 0;
  for (const SegmentRef& s : tile.segments) sum += s.length;
  return sum;
}

bool may_be_equal(const TileRecord& a, const TileRecord& b) {
  return a.codec == b.codec && std::equal(a.segments.begin(), a.segments.end(), b.segments.begin(),
                                          b.segments.end(), [](const SegmentRef& s, const SegmentRef& t) {
                                            return s.length == t.length && s.crc == t.crc;
                                          });
}

class Comparison {
 public:
  Comparison(const MapArchive& from, const MapArchive& to, bool with_hashes)
      : from_(from), to_(to), with_hashes_(with_hashes) {}

  Result<std::vector<TileChange>> run() {
    const auto &a = from_.tiles(), &b = to_.tiles();
    for (std::size_t i = 0, j = 0; i < a.size() || j < b.size();) {
      const auto order = i == a.size()   ? std::strong_ordering::greater
                         : j == b.size() ? std::strong_ordering::less
                                         : compare_tiles(a[i].submap, a[i].key, b[j].submap, b[j].key);
      const TileRecord* before = order <= 0 ? &a[i++] : nullptr;
      const TileRecord* after = order >= 0 ? &b[j++] : nullptr;
      MAPCODEC_TRY(compare(before, after, j - 1));
    }
    return std::move(changes_);
  }

 private:
  Result<bool> equal(const TileRecord& a, const TileRecord& b) const {
    if (from_.shares_store(to_) && a.segments == b.segments) return a.codec == b.codec;
    if (!may_be_equal(a, b)) return false;
    MAPCODEC_ASSIGN(const ContentHash before, from_.hash(a));
    MAPCODEC_ASSIGN(const ContentHash after, to_.hash(b));
    return before == after;
  }

  Status compare(const TileRecord* before, const TileRecord* after, std::size_t index) {
    if (before && after) {
      MAPCODEC_ASSIGN(const bool same, equal(*before, *after));
      if (same) return {};
    }
    const TileRecord& tile = after ? *after : *before;
    TileChange change;
    change.kind = !before ? ChangeKind::added : after ? ChangeKind::changed : ChangeKind::removed;
    change.submap = tile.submap;
    change.key = tile.key;
    if (before) change.points_before = before->points, change.bytes_before = segment_bytes(*before);
    if (after) change.points_after = after->points, change.bytes_after = segment_bytes(*after);
    if (after) change.tile = index;
    if (after && with_hashes_) {
      MAPCODEC_ASSIGN(change.hash, to_.hash(*after));
    }
    changes_.push_back(change);
    return {};
  }

  const MapArchive &from_, &to_;
  bool with_hashes_;
  std::vector<TileChange> changes_;
};

Result<std::vector<TileChange>> everything(const MapArchive& archive) {
  std::vector<TileChange> changes;
  for (std::size_t i = 0; i < archive.tiles().size(); ++i) {
    const TileRecord& tile = archive.tiles()[i];
    MAPCODEC_ASSIGN(const ContentHash hash, archive.hash(tile));
    changes.push_back(
        {ChangeKind::added, tile.submap, tile.key, 0, tile.points, 0, segment_bytes(tile), i, hash});
  }
  return changes;
}

}  // namespace

Result<std::vector<TileChange>> diff_maps(const MapArchive& from, const MapArchive& to, bool with_hashes) {
  return Comparison(from, to, with_hashes).run();
}

Result<std::vector<TileChange>> changes_since(const MapArchive& archive, std::uint64_t since) {
  if (since > archive.revision()) {
    return make_error(ErrorCode::kInvalidArgument, "revision " + std::to_string(since) +
                                                       " is newer than revision " +
                                                       std::to_string(archive.revision()));
  }
  if (since == 0) return everything(archive);
  MAPCODEC_ASSIGN(const MapArchive before, archive.at(since));
  return diff_maps(before, archive, true);
}

Result<std::vector<std::size_t>> missing_tiles(const MapArchive& archive, const std::set<ContentHash>& have) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < archive.tiles().size(); ++i) {
    MAPCODEC_ASSIGN(const ContentHash hash, archive.hash(archive.tiles()[i]));
    if (!have.contains(hash)) missing.push_back(i);
  }
  return missing;
}

}  // namespace mapcodec
