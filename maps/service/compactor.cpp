// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/compactor.hpp"

#include <ctime>

namespace mapcodec {
namespace {

constexpr std::uint64_t kLeastDeadBytes = std::uint64_t{1} << 20;
constexpr double kSegmentsPerTile = 1.5;
// Before calls have to wait for a compaction again the file is so much longer than after the last one.
constexpr double kGrowth = 2;

std::uint64_t segments_of(const MapArchive& archive) {
  std::uint64_t segments = 0;
  for (const TileRecord& t : archive.tiles()) segments += t.segments.size();
  return segments;
}

}  // namespace

std::uint64_t live_bytes(const MapArchive& archive) {
  std::uint64_t bytes = 0;
  for (const TileRecord& t : archive.tiles()) {
    for (const SegmentRef& s : t.segments) bytes += s.length;
  }
  return bytes;
}

Compactor::Compactor(MapRegistry& registry, ServiceContext& context)
    : registry_(registry), context_(context) {
  thread_ = std::thread([this] { watch(); });
}

void Compactor::stop() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    for (const HostedMapPtr& map : registry_.all()) map->wanted = true;
    wake_.notify_one();
  }
  if (thread_.joinable()) thread_.join();
}

void Compactor::watch() {
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, std::chrono::seconds(1), [&] { return ending_.load(); })) {
    lock.unlock();
    for (const HostedMapPtr& map : registry_.all()) {
      map->reader.forget_old_files();
      if (ending_) break;
      const Due when = due(*map);
      if (when != Due::no) compact_quietly(*map, when == Due::at_rest);
    }
    lock.lock();
  }
}

Compactor::Due Compactor::due(HostedMap& map) const {
  const ServiceSettings& s = context_.settings;
  if (s.compact_idle_s <= 0 || map.last_use_ns == 0) return Due::no;
  const auto idle = std::chrono::steady_clock::now().time_since_epoch().count() - map.last_use_ns;
  const bool rests = !map.worker.has_work() && double(idle) * 1e-9 >= s.compact_idle_s;
  const auto view = map.view();
  if (!view.ok()) return Due::no;
  const MapArchive& archive = *(*view)->archive;
  if (archive.revision() == map.compacted_revision) return Due::no;
  const std::uint64_t file = archive.file_bytes(), dead = file - std::min(file, live_bytes(archive));
  const double share = file > 0 ? double(dead) / double(file) : 0;
  if (!rests) {
    // Once is enough where kept revisions are what makes the file long.
    const bool grown = double(file) > kGrowth * double(map.compacted_bytes);
    return share > s.compact_must_share && dead > s.compact_must_bytes && grown ? Due::now : Due::no;
  }
  const bool is_dead = dead > kLeastDeadBytes && share > s.compact_dead_share;
  const bool many = double(segments_of(archive)) > kSegmentsPerTile * double(archive.tiles().size());
  return is_dead || many ? Due::at_rest : Due::no;
}

void Compactor::compact_quietly(HostedMap& map, bool gives_way) {
  (void)context_.catalogue.job(map.name, "compact", "begun").ok();
  const auto report = compact(map, {}, gives_way);
  (void)context_.catalogue.job(map.name, "compact", report.ok() ? "done" : report.error().to_string()).ok();
}

/// What updates left pending becomes part of its tiles, in a revision of its own where there is any.
Status Compactor::fold(const std::string& path, const std::atomic<bool>& stop) const {
  const auto editor = context_.coding.edit(path, &stop);
  // What cannot be edited has nothing to fold.
  if (!editor.ok() && editor.error().code == ErrorCode::kUnsupported) return {};
  if (!editor.ok()) return editor.error();
  MAPCODEC_TRY((*editor)->fold());
  MAPCODEC_TRY((*editor)->commit(std::time(nullptr)));
  return {};
}

Result<CompactReport> Compactor::compact(HostedMap& map, const CompactJob& job, bool gives_way) {
  using Counter = ServiceMetrics::Counter;
  MAPCODEC_ASSIGN(const Retention retention, context_.catalogue.retention(map.name));
  if (gives_way) map.wanted = false;
  const std::atomic<bool>& stop = gives_way ? map.wanted : ending_;
  CompactSettings settings;
  settings.hashes = true;
  settings.keep_last = std::max<std::uint64_t>(1, job.keep_last.value_or(retention.keep_last));
  settings.stop = [this, &stop] { return ending_ || stop; };
  CompactReport report;
  const Status s = map.worker.run([&](EditingDesk& desk) -> Status {
    desk.put_away();
    map.compacting = true;
    ++context_.compacting;
    Status done = fold(desk.path(), stop);
    if (done.ok()) {
      auto compacted = compact_archive(desk.path(), settings);
      if (compacted.ok()) report = std::move(compacted).value();
      if (!compacted.ok()) done = compacted.error();
    }
    --context_.compacting;
    map.compacting = false;
    desk.tell_changed();
    return done;
  });
  if (!s.ok()) {
    const bool stopped = s.error().code == ErrorCode::kCancelled;
    context_.metrics.add(stopped ? Counter::compactions_stopped : Counter::compaction_failures);
    return s.error();
  }
  context_.metrics.add(Counter::compactions);
  if (const auto view = map.view(); view.ok()) {
    map.compacted_revision = (*view)->archive->revision();
    map.compacted_bytes = (*view)->archive->file_bytes();
  }
  return report;
}

}  // namespace mapcodec
