// SPDX-License-Identifier: GPL-3.0-or-later
// One map of the service as its writers see it: a queue, and a thread that makes commits of what is in it.
#pragma once

#include <condition_variable>
#include <deque>
#include <thread>
#include <variant>

#include "maps/service/map_reader.hpp"
#include "maps/service/watch_list.hpp"
#include "maps/service/writer_table.hpp"

namespace mapcodec {

/// What the worker's thread has in hands. Threads: the worker's only.
class EditingDesk {
 public:
  EditingDesk(std::string path, MapReader& reader, WatchList& watchers, ServiceContext& context)
      : path_(std::move(path)), reader_(reader), watchers_(watchers), context_(context) {}
  ~EditingDesk() { put_away(); }

  [[nodiscard]] const std::string& path() const { return path_; }
  /// The archive's one editor, opened where it is not. Errors: as MapCoding::edit; Busy (too many are open).
  [[nodiscard]] Result<MapEditor*> editor();
  /// Closes it: what was not committed is forgotten.
  void put_away();
  /// Commits what the editor was told, and tells everybody. After an error the editor is put away.
  [[nodiscard]] Result<EditReport> commit();
  /// The archive was changed by other means.
  void tell_changed();
  [[nodiscard]] WriterTable& writers() { return writers_; }
  [[nodiscard]] bool is_open() const { return open_; }

 private:
  const std::string path_;
  MapReader& reader_;
  WatchList& watchers_;
  ServiceContext& context_;
  std::unique_ptr<MapEditor> editor_;
  WriterTable writers_;
  std::atomic<bool> open_{false};
};

/// Threads: from many at once. The thread ends, and the archive's lock is given back, when there was nothing
/// to do for a while.
class MapWorker {
 public:
  using Done = std::function<void(const Result<ScanReceipt>&)>;
  using Job = std::function<Status(EditingDesk&)>;

  MapWorker(const std::string& path, MapReader& reader, WatchList& watchers, ServiceContext& context)
      : context_(context), desk_(path, reader, watchers, context) {}
  /// Commits what is queued.
  ~MapWorker() { finish(); }

  /// @param scan  checked, points in the frame of their submap. Errors: Busy.
  [[nodiscard]] Status insert(Scan scan, Done done);
  /// Waits until the thread has done `job`, after everything that was queued before. Errors: Busy; the job's.
  [[nodiscard]] Status run(Job job);
  /// Takes nothing more; waits until the queue is empty and the archive closed.
  void finish();

  /// The service holds the archive's lock.
  [[nodiscard]] bool holds_archive() const { return desk_.is_open(); }
  [[nodiscard]] bool has_work() const { return waiting_ > 0; }
  [[nodiscard]] std::uint64_t queued_scans() const { return queued_scans_; }
  [[nodiscard]] std::uint64_t queued_points() const { return queued_points_; }

 private:
  struct QueuedScan {
    Scan scan;
    Done done;
    std::size_t points = 0;
  };
  struct QueuedJob {
    Job job;
    std::function<void(const Status&)> done;
  };
  using Item = std::variant<QueuedScan, QueuedJob>;

  [[nodiscard]] Status enqueue(Item item);
  void work();
  void gather(std::unique_lock<std::mutex>& lock);
  [[nodiscard]] std::vector<QueuedScan> take_scans();
  void commit(std::vector<QueuedScan> batch);
  [[nodiscard]] Status put(std::vector<QueuedScan>& batch, std::vector<Result<ScanReceipt>>& results);
  [[nodiscard]] Result<ScanReceipt> put_scan(MapEditor& editor, QueuedScan& queued);

  ServiceContext& context_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<Item> queue_;
  std::size_t jobs_ = 0;
  bool running_ = false, finishing_ = false;
  std::thread thread_;
  EditingDesk desk_;
  std::atomic<std::uint64_t> queued_scans_{0}, queued_points_{0}, waiting_{0};
};

}  // namespace mapcodec
