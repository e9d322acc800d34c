// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/local_map.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "parallel/guard.hpp"
#include "parallel/runner.hpp"
#include "slam_adapter/local_map_builder.hpp"

namespace mapcodec {
namespace {

using Clock = std::chrono::steady_clock;
/// How often to look whether somebody let go of an old view, while memory waits for that. Views have no way
/// back to the map, which they may outlive.
constexpr std::chrono::milliseconds kLookForMemory{5};
constexpr double kLongestWait = 1e7;

double now_s() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

Result<LocalMapSettings> checked(LocalMapSettings s) {
  if (s.keep_radius_m == 0) s.keep_radius_m = 1.25 * s.radius_m;
  const auto wrong = [](const char* what) { return make_error(ErrorCode::kInvalidArgument, what); };
  if (!(s.radius_m > 0) || !std::isfinite(s.radius_m))
    return wrong("radius of the local map is not positive");
  if (!(s.keep_radius_m >= s.radius_m)) return wrong("keep radius is smaller than the radius");
  if (!(s.ahead_s >= 0) || !std::isfinite(s.ahead_s)) return wrong("time to look ahead is negative");
  if (s.memory_bytes == 0) return wrong("the local map has no memory");
  if (!s.content.points && !s.content.patches) return wrong("neither points nor patches are to be kept");
  return s;
}

}  // namespace

/// Two locks, always taken in this order: `state` guards what is decided, `door` what callers touch; callers
/// take only the door, which is never held for longer than a few assignments. No lock is held while TBB runs,
/// a tile is read, or a view is let go of.
struct LocalMap::Impl {
  Impl(const LocalMapSettings& s, Arena& a, std::shared_ptr<const MapRevision> first)
      : settings(s), arena(a), builder(s, std::move(first)), view(builder.new_view()) {}

  struct Done {
    LocalMapBuilder::Job job;
    LocalMapBuilder::Loaded loaded;
  };
  struct Step {
    std::optional<LocalMapBuilder::Job> job;
    bool again = false;
  };

  void dispatch();
  void work();
  Step step(std::optional<Done> done, bool take_job);
  void catch_up();
  std::shared_ptr<const LocalMapView> publish(std::shared_ptr<const LocalMapView> next);
  bool settled(bool coarse) const;
  Result<bool> wait(double timeout_s, bool coarse) const;
  Result<bool> answer(bool coarse) const;

  const LocalMapSettings settings;
  Arena& arena;
  std::string path;

  std::mutex state;
  LocalMapBuilder builder;
  std::uint64_t planned = 0;  ///< sequence of the last plan

  mutable std::mutex door;
  mutable std::condition_variable work_comes, view_comes;
  Motion motion;
  bool posed = false;          ///< somebody called move_to
  std::uint64_t sequence = 0;  ///< poses and revisions so far
  std::uint64_t revision = 0;  ///< the newest one asked for
  std::shared_ptr<const MapRevision> next_revision;
  std::shared_ptr<const LocalMapView> view;
  bool news = false;

  std::atomic<bool> stop{false}, drained{false}, unfinished{false}, look_for_memory{false};
  std::thread thread;
};

void LocalMap::Impl::dispatch() {
  while (!stop) {
    {
      std::unique_lock lock(door);
      const auto called = [&] { return stop || news; };
      if (look_for_memory) {
        work_comes.wait_for(lock, kLookForMemory, called);
      } else {
        work_comes.wait(lock, called);
      }
      news = false;
    }
    do {
      drained = unfinished = false;
      const auto some = [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) work();
      };
      const Status s = parallel_detail::guarded("loading tiles", [&]() -> Status {
        TbbRunner(arena).run(static_cast<std::size_t>(arena.threads()), some);
        return {};
      });
      // Only lack of memory ends here, outside any tile; there may be some again soon.
      if (!s.ok()) look_for_memory = true;
    } while (unfinished && !stop);
  }
}

/// Loads tile after tile. Ends when nothing is left, or another thread saw nothing left: what came since is
/// then shared out anew among all threads.
void LocalMap::Impl::work() {
  Step next = step(std::nullopt, true);
  while (next.job || next.again) {
    std::optional<Done> done;
    if (next.job) {
      LocalMapBuilder::Job job = std::move(*next.job);
      const MapRevision& r = *job.revision;
      auto loaded = load_local_tile(*r.archive, r.schema, r.record(job.tile), settings.content, job.level,
                                    settings.limits, std::move(job.reserved));
      done.emplace(Done{std::move(job), std::move(loaded)});
    }
    const bool end = stop || drained;
    if (end) unfinished = true;
    next = step(std::move(done), !end);
  }
  drained = true;
}

LocalMap::Impl::Step LocalMap::Impl::step(std::optional<Done> done, bool take_job) {
  // Declared before the lock: tiles are let go of after it.
  std::shared_ptr<const LocalMapView> before;
  std::vector<std::shared_ptr<const LocalTile>> trash;
  const std::lock_guard lock(state);
  if (done) {
    builder.finish(done->job.revision.get(), done->job.tile, done->job.bytes, std::move(done->loaded));
  }
  catch_up();
  Step r;
  if (take_job) {
    r.job = builder.next_job();
    r.again = !r.job && builder.gave_up_tiles();
    look_for_memory = builder.waits_for_views();
  }
  before = publish(builder.new_view());
  trash = builder.take_trash();
  return r;
}

/// Takes over what callers asked for since.
void LocalMap::Impl::catch_up() {
  std::shared_ptr<const MapRevision> revision_now;
  Motion motion_now;
  std::uint64_t sequence_now = 0;
  bool posed_now = false;
  {
    const std::lock_guard lock(door);
    posed_now = posed;
    revision_now = std::move(next_revision);
    next_revision = nullptr;
    motion_now = motion;
    sequence_now = sequence;
  }
  const bool replan = revision_now || sequence_now != planned;
  if (revision_now) builder.set_revision(std::move(revision_now));
  if (!replan || !posed_now) return;
  builder.plan(motion_now.position(), motion_now.velocity(), sequence_now);
  planned = sequence_now;
}

/// @return the view before, to be let go of.
std::shared_ptr<const LocalMapView> LocalMap::Impl::publish(std::shared_ptr<const LocalMapView> next) {
  if (!next) return nullptr;
  {
    const std::lock_guard lock(door);
    view.swap(next);
  }
  view_comes.notify_all();
  return next;
}

bool LocalMap::Impl::settled(bool coarse) const {
  if (!posed || LocalMapBuilder::sequence_of(*view) != sequence) return false;
  return view->starved() || (coarse ? view->coarse_ready() : view->ready());
}

Result<bool> LocalMap::Impl::answer(bool coarse) const {
  if (!settled(coarse)) return false;
  for (const LocalMapView::Fault& f : view->faults())
    if (f.error.code == ErrorCode::kLimitExceeded) return f.error;
  if (!view->starved() || (coarse && view->coarse_ready())) return true;
  return make_error(ErrorCode::kLimitExceeded,
                    "the budget of " + std::to_string(settings.memory_bytes) +
                        " bytes does not hold all tiles within " + std::to_string(settings.radius_m) +
                        " m: " + std::to_string(view->missing() + view->coarse()) + " are missing or coarse");
}

Result<bool> LocalMap::Impl::wait(double timeout_s, bool coarse) const {
  const double seconds = timeout_s > 0 ? std::min(timeout_s, kLongestWait) : 0;
  std::unique_lock lock(door);
  view_comes.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return settled(coarse); });
  return answer(coarse);
}

LocalMap::LocalMap(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {
  impl_->thread = std::thread([state = impl_.get()] { state->dispatch(); });
}

LocalMap::~LocalMap() {
  {
    const std::lock_guard lock(impl_->door);
    impl_->stop = true;
  }
  impl_->work_comes.notify_all();
  impl_->thread.join();
}

Result<std::unique_ptr<LocalMap>> LocalMap::open(const std::string& path, const LocalMapSettings& settings,
                                                 Arena& arena) {
  MAPCODEC_ASSIGN(MapArchive archive, MapArchive::open(path));
  MAPCODEC_ASSIGN(std::unique_ptr<LocalMap> map,
                  over(std::make_shared<MapArchive>(std::move(archive)), settings, arena));
  map->impl_->path = path;
  return map;
}

Result<std::unique_ptr<LocalMap>> LocalMap::over(std::shared_ptr<const MapArchive> archive,
                                                 const LocalMapSettings& settings, Arena& arena) {
  MAPCODEC_ASSIGN(const LocalMapSettings s, checked(settings));
  const std::uint64_t revision = archive->revision();
  return parallel_detail::guarded("local map", [&]() -> Result<std::unique_ptr<LocalMap>> {
    MAPCODEC_ASSIGN(std::shared_ptr<const MapRevision> read, read_revision(std::move(archive)));
    auto impl = std::make_unique<Impl>(s, arena, std::move(read));
    impl->revision = revision;
    return std::unique_ptr<LocalMap>(new LocalMap(std::move(impl)));
  });
}

Status LocalMap::move_to(const MapPose& T_map_robot, std::optional<double> stamp_s) {
  MAPCODEC_TRY(check_pose(T_map_robot.translation_m, T_map_robot.rotation_xyzw));
  if (stamp_s && !std::isfinite(*stamp_s))
    return make_error(ErrorCode::kInvalidArgument, "time stamp of a pose is not finite");
  {
    const std::lock_guard lock(impl_->door);
    impl_->motion.move_to(T_map_robot.translation_m, stamp_s.value_or(now_s()));
    impl_->posed = true;
    ++impl_->sequence;
    impl_->news = true;
  }
  impl_->work_comes.notify_one();
  return {};
}

std::shared_ptr<const LocalMapView> LocalMap::view() const {
  const std::lock_guard lock(impl_->door);
  return impl_->view;
}

Result<bool> LocalMap::wait_ready(double timeout_s) const {
  return impl_->wait(timeout_s, false);
}
Result<bool> LocalMap::wait_coarse(double timeout_s) const {
  return impl_->wait(timeout_s, true);
}

Result<bool> LocalMap::refresh() {
  if (impl_->path.empty())
    return make_error(ErrorCode::kInvalidArgument, "this local map was not opened from a file");
  MAPCODEC_ASSIGN(MapArchive archive, MapArchive::open(impl_->path));
  {
    const std::lock_guard lock(impl_->door);
    if (archive.revision() == impl_->revision) return false;
  }
  MAPCODEC_TRY(refresh(std::make_shared<MapArchive>(std::move(archive))));
  return true;
}

Status LocalMap::refresh(std::shared_ptr<const MapArchive> archive) {
  const std::uint64_t revision = archive->revision();
  MAPCODEC_ASSIGN(std::shared_ptr<const MapRevision> read, read_revision(std::move(archive)));
  {
    const std::lock_guard lock(impl_->door);
    impl_->revision = revision;
    impl_->next_revision.swap(read);
    ++impl_->sequence;
    impl_->news = true;
  }
  impl_->work_comes.notify_one();
  return {};
}

LocalMemory LocalMap::memory() const {
  const MemoryBudget& b = impl_->builder.budget();
  return {b.used(), b.peak(), b.limit()};
}

const LocalMapSettings& LocalMap::settings() const {
  return impl_->settings;
}

}  // namespace mapcodec
