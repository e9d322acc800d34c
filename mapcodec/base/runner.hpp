// SPDX-License-Identifier: GPL-3.0-or-later
// The codec never starts a thread: who wants parallel work hands in a Runner (parallel/ has the TBB one).
#pragma once

#include <cstddef>
#include <functional>

namespace mapcodec {

/// Runs `body(begin, end)` over pieces of [0, count). Pieces may run at the same time, in any order;
/// `run` returns when all are done. Which pieces there are must not change the caller's result.
class Runner {
 public:
  virtual ~Runner() = default;
  virtual void run(std::size_t count,
                   const std::function<void(std::size_t begin, std::size_t end)>& body) = 0;
};

/// The plain one: the whole range, on the caller's thread.
class SerialRunner final : public Runner {
 public:
  void run(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) override {
    if (count > 0) body(0, count);
  }
};

}  // namespace mapcodec
