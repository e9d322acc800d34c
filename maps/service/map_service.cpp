// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/map_service.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <system_error>

#include "maps/map_writer.hpp"
#include "maps/service/compactor.hpp"
#include "maps/service/scan_check.hpp"

namespace mapcodec {

struct MapService::Impl {
  Impl(const ServiceSettings& s, MapCoding& c, MapCatalogue& k, ServiceMetrics& m)
      : context(s, c, k, m), maps(context) {}

  [[nodiscard]] Result<HostedMapPtr> use(const std::string& name) const {
    MAPCODEC_ASSIGN(HostedMapPtr map, maps.find(name));
    map->touch();
    return map;
  }
  /// A change that the map's editor makes, as one commit.
  [[nodiscard]] Result<std::uint64_t> edit(const std::string& name,
                                           const std::function<Status(MapEditor&)>& change) const;
  /// A change for which the archive is opened anew.
  [[nodiscard]] Result<std::uint64_t> rewrite(const std::string& name,
                                              const std::function<Status(MapWriter&)>& change) const;

  ServiceContext context;
  MapRegistry maps;
  std::unique_ptr<Compactor> compactor;
};

MapService::MapService(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
MapService::~MapService() {
  drain();
}

Result<std::unique_ptr<MapService>> MapService::open(const ServiceSettings& settings, MapCoding& coding,
                                                     MapCatalogue& catalogue, ServiceMetrics& metrics) {
  auto impl = std::make_unique<Impl>(settings, coding, catalogue, metrics);
  MAPCODEC_TRY(impl->maps.scan_folder());
  try {
    impl->compactor = std::make_unique<Compactor>(impl->maps, impl->context);
  } catch (const std::system_error& e) {
    return make_error(ErrorCode::kLimitExceeded, std::string("no thread can be made: ") + e.what());
  }
  return std::unique_ptr<MapService>(new MapService(std::move(impl)));
}

std::vector<MapEntry> MapService::list() const {
  std::vector<MapEntry> entries;
  for (const HostedMapPtr& map : impl_->maps.all()) {
    MapEntry entry;
    entry.name = map->name;
    if (const auto view = map->view(); view.ok()) {
      const MapArchive& archive = *(*view)->archive;
      entry.revision = archive.revision();
      entry.tiles = archive.tiles().size();
      for (const TileRecord& t : archive.tiles()) entry.points += t.points;
      entry.bytes = archive.file_bytes();
      entry.timestamp_s = archive.timestamp_s();
    } else {
      entry.fault = view.error().to_string();
    }
    entries.push_back(std::move(entry));
  }
  return entries;
}

Status MapService::create(const std::string& name, const NewMap& map, const Retention& retention,
                          const std::string& principal) {
  if (impl_->context.draining) return make_error(ErrorCode::kBusy, "the service is about to end");
  MAPCODEC_ASSIGN(MapRegistry::Claim claim, impl_->maps.claim(name));
  MAPCODEC_TRY(impl_->context.coding.create(impl_->maps.path_of(name), map));
  MAPCODEC_TRY(impl_->context.catalogue.created(name, retention, principal));
  claim.keep();
  return {};
}

namespace {

/// Whether all that `archive` holds is what it says: checksums, and that each tile decodes to as many points.
Status check_whole(const MapArchive& archive, const MapCoding& coding) {
  MAPCODEC_ASSIGN(const VerifyReport report, archive.verify());
  if (!report.ok()) return report.findings.front();
  const auto schema = read_schema(archive.info().schema);
  if (!schema.ok()) return make_error(ErrorCode::kArchiveDamaged, "the archive's schema cannot be read");
  for (const TileRecord& t : archive.tiles()) {
    std::vector<Bytes> segments;
    for (const SegmentRef& s : t.segments) {
      MAPCODEC_ASSIGN(Bytes bytes, archive.read(s));
      segments.push_back(std::move(bytes));
    }
    const auto cloud = coding.decode({segments.begin(), segments.end()}, *schema, std::nullopt, {});
    if (!cloud.ok())
      return make_error(ErrorCode::kArchiveDamaged,
                        "tile " + tile_name(t) + ": " + cloud.error().to_string());
    if (cloud->size() != t.points)
      return make_error(ErrorCode::kArchiveDamaged,
                        "tile " + tile_name(t) + " does not have the points that it claims");
  }
  return {};
}

}  // namespace

Status MapService::adopt(const std::string& name, const std::string& path, const std::string& principal) {
  MAPCODEC_ASSIGN(MapRegistry::Claim claim, impl_->maps.claim(name));
  MAPCODEC_ASSIGN(const MapArchive archive, MapArchive::open(path));
  MAPCODEC_TRY(check_whole(archive, impl_->context.coding));
  if (std::rename(path.c_str(), impl_->maps.path_of(name).c_str()) != 0)
    return make_error(ErrorCode::kCannotWrite, "the archive cannot be put in its place");
  MAPCODEC_TRY(impl_->context.catalogue.created(name, {}, principal));
  claim.keep();
  return {};
}

Status MapService::remove(const std::string& name) {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->maps.find(name));
  MAPCODEC_TRY(map->worker.run([&](EditingDesk& desk) -> Status {
    desk.put_away();
    std::error_code error;
    std::filesystem::remove(desk.path(), error);
    if (error) return make_error(ErrorCode::kCannotWrite, "the map cannot be removed: " + error.message());
    map->reader.close();
    return {};
  }));
  MAPCODEC_TRY(impl_->maps.take_out(name));
  map->worker.finish();
  map->watchers.tell();
  return impl_->context.catalogue.removed(name);
}

Result<MapViewPtr> MapService::view(const std::string& name) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  return map->view();
}

Result<MapViewPtr> MapService::view(const std::string& name, const std::string& revision) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  MAPCODEC_ASSIGN(const MapViewPtr newest, map->view());
  return map->reader.at(newest, revision);
}

Result<MapViewPtr> MapService::view_of_file(const std::string& name, std::uint64_t file) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  return map->reader.of_file(file);
}

Result<std::vector<std::shared_ptr<const Bytes>>> MapService::segments(const MapView& view,
                                                                       std::size_t tile) const {
  std::vector<std::shared_ptr<const Bytes>> all;
  for (const SegmentRef& s : view.archive->tiles()[tile].segments) {
    const SegmentCache::Key key{view.file, s.offset};
    auto bytes = impl_->context.cache.find(key);
    if (bytes == nullptr) {
      MAPCODEC_ASSIGN(Bytes read, view.archive->read(s));
      bytes = std::make_shared<const Bytes>(std::move(read));
      impl_->context.cache.put(key, bytes);
    }
    all.push_back(std::move(bytes));
  }
  return all;
}

Status MapService::insert(const std::string& name, Scan scan,
                          std::function<void(const Result<ScanReceipt>&)> done) {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  // Schemas never change: any view that is there will do.
  MapViewPtr view = map->reader.last_opened();
  if (view == nullptr) {
    MAPCODEC_ASSIGN(view, map->view());
  }
  MAPCODEC_TRY(prepare_scan(scan, view->schema, impl_->context.settings, impl_->context.coding));
  return map->worker.insert(std::move(scan), std::move(done));
}

std::uint64_t MapService::retry_after_ms() const {
  const double seconds =
      double(impl_->context.queued_points) / std::max(1e4, impl_->context.points_per_second.load());
  return static_cast<std::uint64_t>(std::clamp(500 * seconds, 50.0, 5000.0));
}

Result<std::uint64_t> MapService::last_sequence(const std::string& name, const std::string& writer) const {
  MAPCODEC_ASSIGN(const MapViewPtr newest, view(name));
  return WriterTable::read(newest->archive->info()).last(writer);
}

Result<std::uint64_t> MapService::Impl::edit(const std::string& name,
                                             const std::function<Status(MapEditor&)>& change) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, use(name));
  std::uint64_t revision = 0;
  const Status done = map->worker.run([&](EditingDesk& desk) -> Status {
    MAPCODEC_ASSIGN(MapEditor* const editor, desk.editor());
    if (const Status s = change(*editor); !s.ok()) {
      desk.put_away();
      return s;
    }
    MAPCODEC_ASSIGN(const EditReport report, desk.commit());
    revision = report.revision;
    return {};
  });
  MAPCODEC_TRY(done);
  return revision;
}

Result<std::uint64_t> MapService::Impl::rewrite(const std::string& name,
                                                const std::function<Status(MapWriter&)>& change) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, use(name));
  std::uint64_t revision = 0;
  const Status done = map->worker.run([&](EditingDesk& desk) -> Status {
    desk.put_away();
    MAPCODEC_ASSIGN(MapWriter writer, MapWriter::open(desk.path()));
    MAPCODEC_TRY(change(writer));
    MAPCODEC_ASSIGN(revision, writer.commit(std::time(nullptr)));
    desk.tell_changed();
    return {};
  });
  MAPCODEC_TRY(done);
  return revision;
}

Result<std::uint64_t> MapService::set_poses(const std::string& name, std::vector<NamedPose> poses) {
  return impl_->edit(name, [&](MapEditor& editor) -> Status {
    std::vector<PoseChange> changes;
    const std::vector<Submap>& submaps = editor.info().submaps;
    for (const NamedPose& p : poses) {
      const auto at =
          std::find_if(submaps.begin(), submaps.end(), [&](const Submap& s) { return s.name == p.submap; });
      if (at == submaps.end())
        return make_error(ErrorCode::kNotFound, "no submap is called '" + p.submap + "'");
      changes.push_back(p.pose);
      changes.back().submap = static_cast<std::uint32_t>(at - submaps.begin());
    }
    return editor.set_poses(changes);
  });
}

Result<std::uint64_t> MapService::erase(const std::string& name, std::optional<Erasure> erasure,
                                        std::optional<std::string> submap) {
  return impl_->edit(name, [&](MapEditor& editor) -> Status {
    std::optional<std::uint32_t> number;
    if (submap) {
      const std::vector<Submap>& submaps = editor.info().submaps;
      const auto at =
          std::find_if(submaps.begin(), submaps.end(), [&](const Submap& s) { return s.name == *submap; });
      if (at == submaps.end())
        return make_error(ErrorCode::kNotFound, "no submap is called '" + *submap + "'");
      number = static_cast<std::uint32_t>(at - submaps.begin());
    }
    return editor.erase(erasure, number);
  });
}

Result<std::uint64_t> MapService::snapshot(const std::string& name, const std::string& snapshot) {
  std::uint64_t named = 0;
  MAPCODEC_TRY(impl_->rewrite(name, [&](MapWriter& writer) {
    named = writer.revision();
    return writer.add_snapshot(snapshot);
  }));
  return named;
}

Result<std::uint64_t> MapService::remove_snapshot(const std::string& name, const std::string& snapshot) {
  return impl_->rewrite(name, [&](MapWriter& writer) { return writer.remove_snapshot(snapshot); });
}

Result<std::uint64_t> MapService::rollback(const std::string& name, const std::string& revision) {
  MAPCODEC_ASSIGN(const MapViewPtr newest, view(name));
  MAPCODEC_ASSIGN(const std::uint64_t number, newest->archive->resolve(revision));
  return impl_->rewrite(name, [&](MapWriter& writer) { return writer.restore(number); });
}

Result<CompactReport> MapService::compact(const std::string& name, const CompactJob& job) {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  return impl_->compactor->compact(*map, job, false);
}

Result<std::unique_ptr<MapService::Watcher>> MapService::watch(const std::string& name,
                                                               std::function<void()> changed) {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->use(name));
  return map->watchers.add(std::move(changed));
}

Result<MapStats> MapService::stats(const std::string& name) const {
  MAPCODEC_ASSIGN(const HostedMapPtr map, impl_->maps.find(name));
  MAPCODEC_ASSIGN(const MapViewPtr view, map->view());
  MapStats s;
  s.revision = view->archive->revision();
  s.tiles = view->archive->tiles().size();
  for (const TileRecord& t : view->archive->tiles()) s.points += t.points;
  s.live_bytes = live_bytes(*view->archive);
  s.file_bytes = view->archive->file_bytes();
  s.queued_scans = map->worker.queued_scans();
  s.queued_points = map->worker.queued_points();
  s.editing = map->worker.holds_archive();
  s.compacting = map->compacting;
  return s;
}

ServiceStats MapService::stats() const {
  const ServiceContext& c = impl_->context;
  ServiceStats s;
  s.maps = impl_->maps.size();
  s.editors = c.editors;
  s.queued_scans = c.queued_scans;
  s.queued_points = c.queued_points;
  s.queue_limit_points = c.settings.queue_points;
  s.cache_bytes = c.cache.bytes();
  s.cache_limit_bytes = c.cache.limit();
  s.cache_hits = c.cache.hits();
  s.cache_misses = c.cache.misses();
  for (const HostedMapPtr& map : impl_->maps.all()) s.watchers += map->watchers.size();
  s.compacting = c.compacting;
  s.draining = c.draining;
  return s;
}

const ServiceSettings& MapService::settings() const {
  return impl_->context.settings;
}
const MapCoding& MapService::coding() const {
  return impl_->context.coding;
}

void MapService::drain() {
  impl_->context.draining = true;
  impl_->compactor->stop();
  for (const HostedMapPtr& map : impl_->maps.all()) map->worker.finish();
}

}  // namespace mapcodec
