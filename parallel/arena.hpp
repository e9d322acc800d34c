// SPDX-License-Identifier: GPL-3.0-or-later
// The threads that a caller grants. A handle, so that nobody needs TBB's headers to hand it on.
#pragma once

#include <functional>
#include <memory>

namespace mapcodec {

/// Owns (or refers to, see tbb_arena.hpp) a tbb::task_arena: whatever is run with it uses at most `threads()`
/// threads. Threads: several callers may use one arena at the same time.
class Arena {
 public:
  struct Impl;

  /// @param threads  0: as many as the process may use. TBB never runs more workers than its global_control
  /// allows,
  ///                 which is the number of cores unless a program's main says otherwise.
  explicit Arena(int threads = 0);
  explicit Arena(std::unique_ptr<Impl> impl);
  ~Arena();
  Arena(Arena&&) noexcept;
  Arena& operator=(Arena&&) noexcept;

  /// At least 1.
  [[nodiscard]] int threads() const;
  /// Runs `work` in the arena and waits for it. What `work` throws comes out here.
  void execute(const std::function<void()>& work);
  [[nodiscard]] Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec
