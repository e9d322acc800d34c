// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/ordered_pipeline.hpp"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <vector>

#include "parallel/guard.hpp"
#include "parallel/turn.hpp"

namespace mapcodec {
namespace {

using parallel_detail::cancelled;
using parallel_detail::guarded;
using parallel_detail::stop_asked;
using parallel_detail::Turn;
using parallel_detail::TurnScope;

class OrderedRun {
 public:
  OrderedRun(std::size_t slots, const OrderedStages& stages, const std::atomic<bool>* stop, const char* what)
      : stages_(stages), stop_(stop), what_(what), status_(slots), turns_(slots) {}

  Status run_serial() {
    std::size_t slot = 0;
    while (feed(slot)) {
      work(slot);
      drain(slot);
    }
    return result_;
  }

  Status run_in(Arena& arena) {
    feeding_.pass();
    arena.execute([this] {
      const auto in = tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order,
                                                          [this](tbb::flow_control& f) {
                                                            std::size_t slot = 0;
                                                            if (!feed(slot)) f.stop();
                                                            return slot;
                                                          });
      const auto middle =
          tbb::make_filter<std::size_t, std::size_t>(tbb::filter_mode::parallel, [this](std::size_t slot) {
            work(slot);
            return slot;
          });
      const auto out = tbb::make_filter<std::size_t, void>(tbb::filter_mode::serial_in_order,
                                                           [this](std::size_t slot) { drain(slot); });
      tbb::parallel_pipeline(status_.size(), in & middle & out);
    });
    feeding_.take();
    draining_.take();
    return result_;
  }

 private:
  /// A failed feed is an item too, so that its error takes its place in the order.
  bool feed(std::size_t& slot) {
    const TurnScope turn(feeding_, feeding_);
    if (ended_ || failed_.load(std::memory_order_relaxed)) return false;
    slot = next_++ % status_.size();
    const TurnScope scope(turns_[slot], turns_[slot]);
    const Result<bool> more = stop_asked(stop_) ? Result<bool>(cancelled(what_))
                                                : guarded(what_, [&] { return stages_.feed(slot); });
    ended_ = !more.ok() || !*more;
    status_[slot] = more.ok() ? Status() : Status(more.error());
    return !more.ok() || *more;
  }
  void work(std::size_t slot) {
    const TurnScope scope(turns_[slot], turns_[slot]);
    if (!status_[slot].ok()) return;
    status_[slot] = stop_asked(stop_) ? cancelled(what_) : guarded(what_, [&] { return stages_.work(slot); });
    if (!status_[slot].ok()) failed_.store(true, std::memory_order_relaxed);
  }
  void drain(std::size_t slot) {
    const TurnScope scope(draining_, turns_[slot]);
    if (!result_.ok()) return;
    result_ = status_[slot].ok() ? guarded(what_, [&] { return stages_.drain(slot); }) : status_[slot];
    if (!result_.ok()) failed_.store(true, std::memory_order_relaxed);
  }

  const OrderedStages& stages_;
  const std::atomic<bool>* stop_;
  const char* what_;
  std::vector<Status> status_;  // one per slot
  std::vector<Turn> turns_;     // one per slot
  Turn feeding_, draining_;
  std::size_t next_ = 0;
  bool ended_ = false;
  std::atomic<bool> failed_{false};
  Status result_;
};

}  // namespace

Status run_ordered(Arena* arena, std::size_t slots, const OrderedStages& stages,
                   const std::atomic<bool>* stop, const char* what) {
  return guarded(what, [&]() -> Status {
    OrderedRun run(std::max<std::size_t>(1, slots), stages, stop, what);
    if (arena == nullptr || arena->threads() == 1) return run.run_serial();
    return run.run_in(*arena);
  });
}

}  // namespace mapcodec
