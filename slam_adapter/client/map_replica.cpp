// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/map_replica.hpp"

#include <algorithm>
#include <filesystem>

namespace mapcodec {
namespace {

// Keys asked for in one call.
constexpr std::size_t kAtOnce = 4096;

std::uint64_t bytes_of(const TileRecord& record) {
  std::uint64_t bytes = 0;
  for (const SegmentRef& s : record.segments) bytes += s.length;
  return bytes;
}

bool reaches(const Box& box, const Vec3& centre, double radius_m) {
  double squared = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    const double out = std::max({box.min[d] - centre[d], 0.0, centre[d] - box.max[d]});
    squared += out * out;
  }
  return squared <= radius_m * radius_m;
}

struct KeyLess {
  bool operator()(const TileSelection::Key& a, const TileSelection::Key& b) const {
    return compare_tiles(a.submap, a.key, b.submap, b.key) < 0;
  }
};

}  // namespace

Result<MapReplica> MapReplica::open(const MapClient& client, const std::string& path) {
  MapReplica replica(client, path);
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored)) {
    MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(path));
    replica.writer_.emplace(std::move(writer));
    replica.writer_->store_hashes(true);
    replica.note_content();
  }
  return replica;
}

void MapReplica::note_content() {
  segments_.clear();
  for (const TileRecord* t : writer_->tiles()) {
    for (std::size_t i = 0; i < t->hashes.size() && i < t->segments.size(); ++i)
      segments_.emplace(t->hashes[i], t->segments[i]);
  }
}

Status MapReplica::begin(const RemoteFacts& facts) {
  if (writer_) return {};
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path_, facts.info, false));
  writer_.emplace(std::move(writer));
  writer_->store_hashes(true);
  return {};
}

/// A tile as it came takes the place of what the copy had.
Status MapReplica::put(const RemoteTile& tile, ReplicaReport& report) {
  const TileRecord& r = tile.record;
  const auto bytes_at = [&](std::size_t i) -> Result<Bytes> {
    if (tile.sent[i]) return tile.segments[i];
    const auto here = i < r.hashes.size() ? segments_.find(r.hashes[i]) : segments_.end();
    if (here == segments_.end())
      return make_error(ErrorCode::kMalformed, "the server left out an unknown segment");
    return writer_->read(here->second);
  };
  std::vector<Bytes> all;
  for (std::size_t i = 0; i < r.segments.size(); ++i) {
    MAPCODEC_ASSIGN(Bytes bytes, bytes_at(i));
    if (tile.sent[i]) report.bytes_fetched += bytes.size();
    all.push_back(std::move(bytes));
  }
  if (all.empty()) return make_error(ErrorCode::kMalformed, "the server sent a tile without segments");
  MAPCODEC_TRY(writer_->add(r.key, r.codec, r.points, r.bounds, r.errors, all.front(), r.submap));
  for (std::size_t i = 1; i < all.size(); ++i)
    MAPCODEC_TRY(writer_->extend(r.key, r.points, r.bounds, r.errors, all[i], r.submap));
  ++report.tiles_fetched;
  return {};
}

Status MapReplica::end(const RemoteFacts& facts, bool own_number, ReplicaReport& report) {
  MAPCODEC_TRY(begin(facts));
  MAPCODEC_TRY(writer_->set_info(facts.info));
  if (!own_number) MAPCODEC_TRY(writer_->number_next(facts.revision));
  MAPCODEC_ASSIGN(report.revision, writer_->commit(facts.timestamp_s));
  for (const TileRecord* t : writer_->tiles()) report.bytes_whole += bytes_of(*t);
  note_content();
  return {};
}

/// Removes what is gone. @return the tiles whose content differs.
Result<MapReplica::Keys> MapReplica::drop_and_list(const RemoteChanges& step, ReplicaReport& report) {
  Keys wanted;
  std::set<TileSelection::Key, KeyLess> there;
  for (const TileChange& c : step.changes) {
    const TileRecord* mine = writer_->find(c.key, c.submap);
    if (c.kind == ChangeKind::removed) {
      if (mine == nullptr) continue;
      MAPCODEC_TRY(writer_->remove(c.key, c.submap));
      ++report.tiles_removed;
      continue;
    }
    there.insert({c.submap, c.key});
    const bool same = mine != nullptr && mine->hashes.size() == mine->segments.size() &&
                      hash_tile(mine->codec, mine->hashes) == c.hash;
    if (!same) wanted.push_back({c.submap, c.key});
  }
  if (!step.reset) return wanted;
  Keys gone;
  for (const TileRecord* t : writer_->tiles()) {
    if (!there.contains({t->submap, t->key})) gone.push_back({t->submap, t->key});
  }
  for (const auto& k : gone) MAPCODEC_TRY(writer_->remove(k.key, k.submap));
  report.tiles_removed += gone.size();
  return wanted;
}

/// @param keys  of this revision, not too many at once.
Status MapReplica::fetch_keys(Keys keys, std::uint64_t revision, ReplicaReport& report) {
  TileRequest request;
  request.revision = std::to_string(revision);
  request.selection.keys = std::move(keys);
  for (const auto& k : request.selection.keys) {
    const TileRecord* mine = writer_->find(k.key, k.submap);
    if (mine != nullptr)
      request.have_segments.insert(request.have_segments.end(), mine->hashes.begin(), mine->hashes.end());
  }
  const std::uint64_t before = report.tiles_fetched;
  MAPCODEC_TRY(client_->tiles(request, nullptr, [&](RemoteTile&& tile) { return put(tile, report); }));
  if (report.tiles_fetched - before != request.selection.keys.size())
    return make_error(ErrorCode::kMalformed, "the server did not send all tiles that it named");
  return {};
}

Result<ReplicaReport> MapReplica::apply(RemoteChanges&& step) {
  ReplicaReport report;
  const std::uint64_t revision = report.revision = step.facts.revision;
  if (writer_ && revision == writer_->revision()) return report;
  if (writer_ && revision < writer_->revision())
    return make_error(ErrorCode::kExists, path_ + ": the copy has revision " +
                                              std::to_string(writer_->revision()) + ", and the server only " +
                                              std::to_string(revision));
  MAPCODEC_TRY(begin(step.facts));
  MAPCODEC_ASSIGN(const Keys wanted, drop_and_list(step, report));
  for (std::size_t i = 0; i < wanted.size(); i += kAtOnce) {
    const auto first = wanted.begin() + std::ptrdiff_t(i);
    const auto last = first + std::ptrdiff_t(std::min(kAtOnce, wanted.size() - i));
    MAPCODEC_TRY(fetch_keys({first, last}, revision, report));
  }
  MAPCODEC_TRY(end(step.facts, false, report));
  return report;
}

Result<ReplicaReport> MapReplica::catch_up() {
  ReplicaReport report;
  const auto take = [&](RemoteChanges&& step) -> Result<bool> {
    MAPCODEC_ASSIGN(report, apply(std::move(step)));
    return true;
  };
  MAPCODEC_TRY(client_->watch(writer_ ? writer_->revision() : 0, true, nullptr, take));
  return report;
}

Status MapReplica::follow(const std::atomic<bool>* stop,
                          const std::function<bool(const ReplicaReport&)>& told) {
  return client_->watch(writer_ ? writer_->revision() : 0, false, stop,
                        [&](RemoteChanges&& step) -> Result<bool> {
                          MAPCODEC_ASSIGN(const ReplicaReport report, apply(std::move(step)));
                          return told(report);
                        });
}

Result<ReplicaReport> MapReplica::fetch_around(const Vec3& centre, double radius_m) {
  TileRequest request;
  request.selection.sphere = {centre, radius_m};
  std::vector<TileSelection::Key> mine;
  if (writer_) {
    const Box box{{centre[0] - radius_m, centre[1] - radius_m, centre[2] - radius_m},
                  {centre[0] + radius_m, centre[1] + radius_m, centre[2] + radius_m}};
    for (const TileRecord* t : writer_->tiles_in(box)) {
      request.have.push_back(hash_tile(t->codec, t->hashes));
      request.have_segments.insert(request.have_segments.end(), t->hashes.begin(), t->hashes.end());
      mine.push_back({t->submap, t->key});
    }
  }
  RemoteFacts facts;
  ReplicaReport report;
  std::vector<TileSelection::Key> there;
  const auto take = [&](RemoteTile&& tile) -> Status {
    MAPCODEC_TRY(begin(facts));
    there.push_back({tile.record.submap, tile.record.key});
    return tile.not_modified ? Status() : put(tile, report);
  };
  MAPCODEC_TRY(client_->tiles(request, &facts, take));
  MAPCODEC_TRY(begin(facts));
  // What lies within and was not named is gone; the box is larger than the sphere.
  for (const auto& k : mine) {
    const bool named = std::any_of(there.begin(), there.end(),
                                   [&](const auto& t) { return t.submap == k.submap && t.key == k.key; });
    const TileRecord* t = writer_->find(k.key, k.submap);
    if (named || !reaches(pose_of(facts.info, k.submap).apply(t->bounds), centre, radius_m)) continue;
    MAPCODEC_TRY(writer_->remove(k.key, k.submap));
    ++report.tiles_removed;
  }
  const bool moved = !(writer_->info().submaps == facts.info.submaps);
  if (report.tiles_fetched + report.tiles_removed == 0 && !moved && writer_->revision() > 0) return report;
  MAPCODEC_TRY(end(facts, true, report));
  return report;
}

}  // namespace mapcodec
