// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/map_worker.hpp"

#include <future>
#include <system_error>

namespace mapcodec {
namespace {

constexpr std::size_t kMaxJobs = 64;

using Clock = std::chrono::steady_clock;

std::chrono::nanoseconds seconds(double s) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(s * 1e9));
}

/// A scan that is wrong by itself leaves the others alone.
bool is_of_scan(ErrorCode code) {
  return code == ErrorCode::kMalformed || code == ErrorCode::kInvalidArgument;
}

}  // namespace

Status MapWorker::enqueue(Item item) {
  const std::lock_guard lock(mutex_);
  if (finishing_ || context_.draining) return make_error(ErrorCode::kBusy, "the service is about to end");
  if (!running_) {
    if (thread_.joinable()) thread_.join();
    try {
      thread_ = std::thread([this] { work(); });
    } catch (const std::system_error&) {
      return make_error(ErrorCode::kBusy, "no thread is left for the map");
    }
    running_ = true;
  }
  jobs_ += std::holds_alternative<QueuedJob>(item);
  queue_.push_back(std::move(item));
  ++waiting_;
  wake_.notify_one();
  return {};
}

Status MapWorker::insert(Scan scan, Done done) {
  const std::size_t points = scan.points.size();
  const std::uint64_t before = context_.queued_points.fetch_add(points);
  Status s = before > 0 && before + points > context_.settings.queue_points
                 ? Status(make_error(ErrorCode::kBusy, "too many points wait to be stored"))
                 : Status();
  ++queued_scans_;
  queued_points_ += points;
  ++context_.queued_scans;
  if (s.ok()) s = enqueue(QueuedScan{std::move(scan), std::move(done), points});
  if (s.ok()) return s;
  --queued_scans_;
  queued_points_ -= points;
  --context_.queued_scans;
  context_.queued_points -= points;
  context_.metrics.add(ServiceMetrics::Counter::busy);
  return s;
}

Status MapWorker::run(Job job) {
  auto result = std::make_shared<std::promise<Status>>();
  std::future<Status> done = result->get_future();
  {
    const std::lock_guard lock(mutex_);
    if (jobs_ >= kMaxJobs) return make_error(ErrorCode::kBusy, "too many changes wait for the map");
  }
  MAPCODEC_TRY(enqueue(QueuedJob{std::move(job), [result](const Status& s) { result->set_value(s); }}));
  return done.get();
}

void MapWorker::finish() {
  {
    const std::lock_guard lock(mutex_);
    finishing_ = true;
    wake_.notify_one();
  }
  if (thread_.joinable()) thread_.join();
}

void MapWorker::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait_for(lock, seconds(context_.settings.editor_idle_s),
                   [&] { return !queue_.empty() || finishing_; });
    if (queue_.empty()) {
      desk_.put_away();
      running_ = false;
      return;
    }
    if (auto* queued = std::get_if<QueuedJob>(&queue_.front())) {
      const QueuedJob job = std::move(*queued);
      queue_.pop_front();
      --jobs_;
      lock.unlock();
      const Status s = job.job(desk_);
      --waiting_;
      job.done(s);
    } else {
      gather(lock);
      std::vector<QueuedScan> batch = take_scans();
      lock.unlock();
      commit(std::move(batch));
    }
    lock.lock();
  }
}

/// Waits a little for scans that can share the commit.
void MapWorker::gather(std::unique_lock<std::mutex>& lock) {
  const auto until = Clock::now() + seconds(context_.settings.commit_after_s);
  wake_.wait_until(lock, until, [&] {
    return queued_points_ >= context_.settings.commit_points || jobs_ > 0 || finishing_;
  });
}

std::vector<MapWorker::QueuedScan> MapWorker::take_scans() {
  std::vector<QueuedScan> batch;
  std::uint64_t points = 0;
  while (!queue_.empty() && points < context_.settings.commit_points) {
    auto* scan = std::get_if<QueuedScan>(&queue_.front());
    if (scan == nullptr) break;
    points += scan->points;
    batch.push_back(std::move(*scan));
    queue_.pop_front();
  }
  return batch;
}

Result<ScanReceipt> MapWorker::put_scan(MapEditor& editor, QueuedScan& queued) {
  Scan& scan = queued.scan;
  if (!scan.writer.empty() && scan.sequence > 0) {
    const std::uint64_t last = std::max(desk_.writers().last(scan.writer), scan.acknowledged);
    if (scan.sequence <= last) return ScanReceipt{0, true};
    if (scan.sequence != last + 1)
      return make_error(ErrorCode::kInvalidArgument,
                        "scan " + std::to_string(scan.sequence) + " of writer '" + scan.writer +
                            "' comes after " + std::to_string(last) + ": those between are missing");
  }
  std::uint32_t submap = 0;
  if (!scan.submap.empty()) {
    MAPCODEC_ASSIGN(submap, editor.submap(scan.submap, scan.T_map_submap));
  }
  MAPCODEC_TRY(editor.insert(std::move(scan.points), submap));
  if (!scan.writer.empty() && scan.sequence > 0) desk_.writers().set(scan.writer, scan.sequence);
  return ScanReceipt{};
}

Status MapWorker::put(std::vector<QueuedScan>& batch, std::vector<Result<ScanReceipt>>& results) {
  MAPCODEC_ASSIGN(MapEditor* const editor, desk_.editor());
  for (QueuedScan& q : batch) {
    results.push_back(put_scan(*editor, q));
    if (!results.back().ok() && !is_of_scan(results.back().error().code)) return results.back().error();
  }
  editor->set_extra(kWritersExtra, desk_.writers().write());
  MAPCODEC_ASSIGN(const EditReport report, desk_.commit());
  for (auto& r : results) {
    if (r.ok()) r->revision = report.revision;
  }
  return {};
}

void MapWorker::commit(std::vector<QueuedScan> batch) {
  const auto begin = Clock::now();
  std::vector<Result<ScanReceipt>> results;
  const Status s = put(batch, results);
  if (!s.ok()) {
    desk_.put_away();
    results.assign(batch.size(), s.error());
  }
  const double took = std::chrono::duration<double>(Clock::now() - begin).count();
  std::uint64_t points = 0;
  for (const QueuedScan& q : batch) points += q.points;
  // Before the answers: whoever gets one may look at the figures.
  queued_scans_ -= batch.size();
  queued_points_ -= points;
  context_.queued_scans -= batch.size();
  context_.queued_points -= points;
  using Counter = ServiceMetrics::Counter;
  context_.metrics.add(s.ok() ? Counter::commits : Counter::commit_failures);
  if (s.ok()) {
    context_.metrics.add(Counter::points_in, double(points));
    context_.metrics.add(Counter::scans_in, double(batch.size()));
    context_.metrics.commit(took, batch.size());
    if (points > 0)
      context_.points_per_second = 0.8 * context_.points_per_second + 0.2 * double(points) / took;
  }
  for (std::size_t i = 0; i < batch.size(); ++i) batch[i].done(results[i]);
  waiting_ -= batch.size();
}

}  // namespace mapcodec
