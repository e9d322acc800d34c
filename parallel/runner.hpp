// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/base/runner.hpp"
#include "parallel/arena.hpp"

namespace mapcodec {

/// Runs pieces of a range on the threads of an arena. What a piece throws comes out of `run`.
/// Threads: `run` may be called by several threads, also from within a piece.
class TbbRunner final : public Runner {
 public:
  /// The arena must outlive the runner.
  explicit TbbRunner(Arena& arena) : arena_(arena) {}
  void run(std::size_t count, const std::function<void(std::size_t begin, std::size_t end)>& body) override;

 private:
  Arena& arena_;
};

}  // namespace mapcodec
