// SPDX-License-Identifier: GPL-3.0-or-later
// Threads for calls that wait or work: gRPC's own threads must do neither.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace mapcodec::daemon {

/// Threads: from many at once.
class WorkerPool {
 public:
  WorkerPool(unsigned threads, std::size_t most_waiting) : most_waiting_(most_waiting) {
    for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  }
  /// Does what is still waiting.
  ~WorkerPool() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    wake_.notify_all();
    for (std::thread& t : threads_) t.join();
  }

  /// @return false: too much waits already, and `job` is not done.
  [[nodiscard]] bool try_post(std::function<void()> job) { return post(std::move(job), most_waiting_); }
  /// For calls that were let in and go on: there are as many as there are calls.
  void go_on(std::function<void()> job) { (void)post(std::move(job), static_cast<std::size_t>(-1)); }

 private:
  bool post(std::function<void()> job, std::size_t most) {
    {
      const std::lock_guard lock(mutex_);
      if (jobs_.size() >= most) return false;
      jobs_.push_back(std::move(job));
    }
    wake_.notify_one();
    return true;
  }
  void work() {
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [&] { return ending_ || !jobs_.empty(); });
      if (jobs_.empty()) return;
      const auto job = std::move(jobs_.front());
      jobs_.pop_front();
      lock.unlock();
      job();
      lock.lock();
    }
  }

  const std::size_t most_waiting_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> jobs_;
  bool ending_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace mapcodec::daemon
