// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>

namespace mapcodec::parallel_detail {

/// What follows a turn sees what came before it on other threads. TBB orders our tasks already, but inside a
/// library that ThreadSanitizer does not look into; said here again, it finds the races that are ours, and
/// only those.
class Turn {
 public:
  void take() const { static_cast<void>(passed_.load(std::memory_order_acquire)); }
  void pass() { passed_.fetch_add(1, std::memory_order_acq_rel); }

 private:
  std::atomic<unsigned> passed_{0};
};

/// Takes turns and passes them on when the scope ends.
class TurnScope {
 public:
  TurnScope(Turn& a, Turn& b) : a_(a), b_(b) {
    a_.take();
    b_.take();
  }
  ~TurnScope() {
    a_.pass();
    b_.pass();
  }
  TurnScope(const TurnScope&) = delete;
  TurnScope& operator=(const TurnScope&) = delete;

 private:
  Turn &a_, &b_;
};

}  // namespace mapcodec::parallel_detail
