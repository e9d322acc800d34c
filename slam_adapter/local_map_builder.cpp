// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map_builder.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

/// A wanted tile goes for one that is wanted sooner by this share of the radius: else two of them would take
/// turns.
constexpr double kMargin = 0.1;

/// Hashes, where both have them; else the place in the file, which is never written twice.
bool same_content(const TileRecord& a, const TileRecord& b) {
  if (a.codec != b.codec || a.points != b.points || a.segments.size() != b.segments.size()) return false;
  const bool hashed = !a.hashes.empty() && a.hashes.size() == b.hashes.size();
  return hashed ? a.hashes == b.hashes : a.segments == b.segments;
}

void forget(std::vector<std::size_t>& list, std::size_t tile) {
  list.erase(std::remove(list.begin(), list.end(), tile), list.end());
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string(bytes / 1000000) + "." + std::to_string(bytes / 100000 % 10) + " MB";
}

}  // namespace

Result<std::shared_ptr<const MapRevision>> read_revision(std::shared_ptr<const MapArchive> archive) {
  auto schema = read_schema(archive->info().schema);
  if (!schema.ok())
    return make_error(ErrorCode::kArchiveDamaged, schema.error().message, schema.error().offset);
  auto r = std::make_shared<MapRevision>();
  r->archive = std::move(archive);
  r->schema = std::move(schema).value();
  const MapInfo& info = r->archive->info();
  for (std::uint32_t s = 0; s < info.submaps.size(); ++s) r->motions.push_back(pose_of(info, s));
  const auto octree = octree_submap(info);  // nowhere, for points
  for (const TileRecord& t : r->archive->tiles())
    r->boxes.push_back(t.submap == octree ? Box{} : r->motion(t.submap).apply(t.bounds));
  return std::shared_ptr<const MapRevision>(std::move(r));
}

LocalMapBuilder::LocalMapBuilder(const LocalMapSettings& settings,
                                 std::shared_ptr<const MapRevision> revision)
    : settings_(settings),
      budget_(std::make_shared<MemoryBudget>(settings.memory_bytes)),
      revision_(std::move(revision)),
      slots_(revision_->boxes.size()) {}

void LocalMapBuilder::set_revision(std::shared_ptr<const MapRevision> revision) {
  std::vector<Slot> slots(revision->boxes.size());
  std::vector<std::size_t> there, failed;
  there_bytes_ = 0;
  for (const std::size_t old : there_) {
    const TileRecord& before = revision_->record(old);
    const auto now = revision->archive->find(before.key, before.submap);
    if (!now || !same_content(before, revision->record(*now))) {
      trash_.push_back(std::move(slots_[old].content));
      continue;
    }
    slots[*now] = std::move(slots_[old]);
    there.push_back(*now);
    there_bytes_ += slots[*now].content->held.bytes();
  }
  for (const std::size_t old : failed_) {
    const TileRecord& before = revision_->record(old);
    const auto now = revision->archive->find(before.key, before.submap);
    if (!now || !same_content(before, revision->record(*now))) continue;
    slots[*now] = std::move(slots_[old]);
    failed.push_back(*now);
  }
  revision_ = std::move(revision);
  slots_ = std::move(slots);
  there_ = std::move(there);
  failed_ = std::move(failed);
  wanted_.clear();
  changed_ = true;
}

void LocalMapBuilder::plan(const Vec3& position, const Vec3& velocity, std::uint64_t sequence) {
  position_ = position;
  sequence_ = sequence;
  ++plans_;
  changed_ = true;
  starved_ = false;
  for (Slot& s : slots_) s.wanted = false;
  wanted_ = wanted_tiles(revision_->boxes, position, velocity, {settings_.radius_m, settings_.ahead_s});
  for (const WantedTile& w : wanted_) {
    Slot& s = slots_[w.tile];
    s.wanted = true;
    s.order = w.order;
    s.last_use = plans_;
  }
  for (const std::size_t tile : there_)
    if (distance_of(tile) <= settings_.keep_radius_m) slots_[tile].last_use = plans_;
}

bool LocalMapBuilder::has_coarse_form(std::size_t tile) const {
  const auto codec = static_cast<CodecId>(revision_->record(tile).codec);
  return settings_.coarse_level && settings_.content.points &&
         (codec == CodecId::surface || codec == CodecId::points);
}

std::optional<LocalMapBuilder::Job> LocalMapBuilder::next_job() {
  gave_up_ = waits_for_views_ = false;
  // First that nothing near is missing, be it coarse; then near tiles in full; then what lies ahead.
  for (int pass = 0; pass < 3; ++pass) {
    for (const WantedTile& w : wanted_) {
      const Slot& s = slots_[w.tile];
      const bool absent = s.state == State::absent;
      const bool coarse = s.state == State::there && s.content->level.has_value();
      if (pass == 0 ? !(w.near && absent) : pass == 1 ? !(w.near && coarse) : !(absent || coarse)) continue;
      const bool coarse_first = pass == 0 && has_coarse_form(w.tile);
      auto job = reserve(w, coarse_first ? settings_.coarse_level : std::nullopt);
      if (job) return job;
      if (s.state != State::failed) return std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<LocalMapBuilder::Job> LocalMapBuilder::reserve(const WantedTile& w,
                                                             std::optional<unsigned> level) {
  const TileRecord& record = revision_->record(w.tile);
  const std::uint64_t bytes = bytes_to_load(record, revision_->schema, settings_.content, level.has_value());
  if (bytes > settings_.memory_bytes) {
    fail(w.tile,
         make_error(ErrorCode::kLimitExceeded,
                    "tile " + tile_name(record) + " alone needs " + megabytes(bytes) +
                        " to be loaded, and the local map's budget is " + megabytes(settings_.memory_bytes)));
    return std::nullopt;
  }
  Reservation reserved = Reservation::of(budget_, bytes);
  if (reserved.bytes() == 0) {
    const bool later = make_room(w, bytes) || loading_ > 0;
    if (!later && w.near && !starved_) starved_ = changed_ = true;
    return std::nullopt;
  }
  Slot& s = slots_[w.tile];
  if (s.state == State::there) {
    // Its coarse form stays in the view meanwhile, but can no longer be given up for another tile.
    there_bytes_ -= s.content->held.bytes();
    forget(there_, w.tile);
  }
  s.state = State::loading;
  ++loading_;
  loading_bytes_ += bytes;
  return Job{revision_, w.tile, level, std::move(reserved), bytes};
}

std::uint64_t LocalMapBuilder::held_elsewhere() const {
  const std::uint64_t used = budget_->used(), ours = there_bytes_ + loading_bytes_;
  return used > ours ? used - ours : 0;
}

/// @return true if memory came or will come free: by tiles given up now, or by old views.
bool LocalMapBuilder::make_room(const WantedTile& w, std::uint64_t bytes) {
  const std::uint64_t limit = budget_->limit(), used = budget_->used();
  std::uint64_t coming = (limit > used ? limit - used : 0) + held_elsewhere();
  if (coming >= bytes) {
    waits_for_views_ = true;
    return true;
  }
  while (coming < bytes) {
    const auto v = victim(w);
    if (!v) break;
    coming += slots_[*v].content->held.bytes();
    give_up(*v);
    gave_up_ = true;
  }
  waits_for_views_ = gave_up_;
  return gave_up_;
}

std::optional<std::size_t> LocalMapBuilder::victim(const WantedTile& w) const {
  std::optional<std::size_t> oldest, last;
  const double least = w.order + kMargin * settings_.radius_m;
  for (const std::size_t tile : there_) {
    const Slot& s = slots_[tile];
    if (!s.wanted && (!oldest || s.last_use < slots_[*oldest].last_use)) oldest = tile;
    if (s.wanted && s.order > least && (!last || s.order > slots_[*last].order)) last = tile;
  }
  return oldest ? oldest : last;
}

void LocalMapBuilder::give_up(std::size_t tile) {
  Slot& s = slots_[tile];
  there_bytes_ -= s.content->held.bytes();
  trash_.push_back(std::move(s.content));
  s.content = nullptr;
  s.state = State::absent;
  forget(there_, tile);
  changed_ = true;
}

void LocalMapBuilder::fail(std::size_t tile, Error error) {
  Slot& s = slots_[tile];
  if (s.state == State::there) give_up(tile);
  if (s.content) trash_.push_back(std::move(s.content));
  s.content = nullptr;
  s.state = State::failed;
  s.error = std::move(error);
  failed_.push_back(tile);
  changed_ = true;
}

void LocalMapBuilder::put(std::size_t tile, std::shared_ptr<const LocalTile> content) {
  Slot& s = slots_[tile];
  if (s.content) trash_.push_back(std::move(s.content));
  there_bytes_ += content->held.bytes();
  s.content = std::move(content);
  s.state = State::there;
  there_.push_back(tile);
  changed_ = true;
}

void LocalMapBuilder::finish(const MapRevision* revision, std::size_t tile, std::uint64_t bytes,
                             Loaded loaded) {
  --loading_;
  loading_bytes_ -= bytes;
  if (revision != revision_.get()) {
    if (loaded.ok()) trash_.push_back(std::move(*loaded));
    return;
  }
  if (!loaded.ok()) return fail(tile, loaded.error());
  put(tile, std::move(*loaded));
}

void LocalMapBuilder::count_near(LocalMapView& view) const {
  for (const WantedTile& w : wanted_) {
    const Slot& s = slots_[w.tile];
    if (!w.near || s.state == State::failed) continue;
    view.missing_ += s.content ? 0U : 1U;
    view.coarse_ += s.content && s.content->level ? 1U : 0U;
  }
}

std::shared_ptr<const LocalMapView> LocalMapBuilder::new_view() {
  if (!changed_) return nullptr;
  changed_ = false;
  auto view = std::make_shared<LocalMapView>();
  view->revision_ = revision_->archive->revision();
  view->sequence_ = sequence_;
  view->center_ = position_;
  view->planned_ = sequence_ > 0;
  view->starved_ = starved_;
  count_near(*view);
  std::vector<std::size_t> shown = there_;
  for (const WantedTile& w : wanted_)
    if (slots_[w.tile].state == State::loading && slots_[w.tile].content) shown.push_back(w.tile);
  // Tiles of one submap side by side: queries are then moved into its frame once.
  std::sort(shown.begin(), shown.end());
  for (const std::size_t tile : shown) {
    if (distance_of(tile) > settings_.keep_radius_m) continue;
    view->tiles_.push_back({slots_[tile].content, revision_->motion(revision_->record(tile).submap)});
  }
  for (const std::size_t tile : failed_) {
    const TileRecord& record = revision_->record(tile);
    if (distance_of(tile) <= settings_.keep_radius_m)
      view->faults_.push_back({record.key, record.submap, *slots_[tile].error});
  }
  return view;
}

}  // namespace mapcodec
