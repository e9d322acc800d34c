// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/remote_map.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>

#include "slam_adapter/client/map_replica.hpp"

namespace mapcodec {
namespace {

// Fetched beyond the radius, so that a robot that moves finds its tiles here.
constexpr double kBeyond = 1.25;

}  // namespace

struct RemoteMap::Impl {
  Impl(MapClient c, const RemoteMapSettings& s) : client(std::move(c)), settings(s) {}

  void work();
  void fetch(const Vec3& centre, std::uint64_t number);

  MapClient client;
  const RemoteMapSettings settings;
  std::optional<MapReplica> replica;  // of the thread
  std::unique_ptr<LocalMap> local;

  mutable std::mutex mutex;
  mutable std::condition_variable changed;
  bool ending = false;
  std::optional<Vec3> centre;
  std::uint64_t asked = 0, answered = 0;  // numbers of poses
  RemoteMapState state;
  std::thread thread;
};

void RemoteMap::Impl::fetch(const Vec3& where, std::uint64_t number) {
  auto report = replica->fetch_around(where, kBeyond * settings.local.radius_m);
  Status s = report.ok() ? Status() : Status(report.error());
  if (report.ok() && report->revision > 0) {
    auto archive = MapArchive::open(settings.cache_file);
    s = archive.ok() ? local->refresh(std::make_shared<const MapArchive>(std::move(archive).value()))
                     : Status(archive.error());
  }
  const std::lock_guard lock(mutex);
  answered = number;
  state.online = s.ok();
  state.fault = s.ok() ? "" : s.error().to_string();
  if (report.ok()) {
    state.tiles_fetched += report->tiles_fetched;
    state.bytes_fetched += report->bytes_fetched;
    state.revision = std::max(state.revision, report->revision);
  }
  changed.notify_all();
}

void RemoteMap::Impl::work() {
  std::unique_lock lock(mutex);
  while (!ending) {
    const auto pause = std::chrono::duration<double>(settings.look_every_s);
    changed.wait_for(lock, pause, [&] { return ending || asked > answered; });
    if (ending || !centre) continue;
    const Vec3 where = *centre;
    const std::uint64_t number = asked;
    lock.unlock();
    fetch(where, number);
    lock.lock();
  }
}

RemoteMap::RemoteMap(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

RemoteMap::~RemoteMap() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->ending = true;
    impl_->changed.notify_all();
  }
  if (impl_->thread.joinable()) impl_->thread.join();
}

Result<std::unique_ptr<RemoteMap>> RemoteMap::open(const std::string& url, const RemoteMapSettings& settings,
                                                   Arena& arena) {
  MAPCODEC_ASSIGN(MapClient client, MapClient::connect(url));
  auto impl = std::make_unique<Impl>(std::move(client), settings);
  MAPCODEC_ASSIGN(MapReplica replica, MapReplica::open(impl->client, settings.cache_file));
  impl->replica.emplace(std::move(replica));
  auto archive = MapArchive::open(settings.cache_file);
  if (!archive.ok()) {
    // No cache yet: the facts come from the server, with no tile.
    MAPCODEC_TRY(impl->replica->fetch_around({0, 0, 0}, 0));
    archive = MapArchive::open(settings.cache_file);
    if (!archive.ok()) return archive.error();
  }
  MAPCODEC_ASSIGN(impl->local, LocalMap::over(std::make_shared<const MapArchive>(std::move(archive).value()),
                                              settings.local, arena));
  Impl* i = impl.get();
  i->thread = std::thread([i] { i->work(); });
  return std::unique_ptr<RemoteMap>(new RemoteMap(std::move(impl)));
}

Status RemoteMap::move_to(const MapPose& T_map_robot, std::optional<double> stamp_s) {
  MAPCODEC_TRY(impl_->local->move_to(T_map_robot, stamp_s));
  const std::lock_guard lock(impl_->mutex);
  impl_->centre = T_map_robot.translation_m;
  ++impl_->asked;
  impl_->changed.notify_all();
  return {};
}

const LocalMap& RemoteMap::local() const {
  return *impl_->local;
}

RemoteMapState RemoteMap::state() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->state;
}

bool RemoteMap::wait_fetched(double timeout_s) const {
  std::unique_lock lock(impl_->mutex);
  const std::uint64_t number = impl_->asked;
  const bool answered = impl_->changed.wait_for(lock, std::chrono::duration<double>(timeout_s),
                                                [&] { return impl_->answered >= number; });
  return answered && impl_->state.online;
}

}  // namespace mapcodec
