// SPDX-License-Identifier: GPL-3.0-or-later
// What is behind Arena, for those who have a tbb::task_arena already.
#pragma once

#include <tbb/task_arena.h>

#include "parallel/arena.hpp"

namespace mapcodec {

struct Arena::Impl {
  std::unique_ptr<tbb::task_arena> owned;
  tbb::task_arena* arena = nullptr;
};

/// An Arena over the caller's, which must outlive it.
[[nodiscard]] inline Arena borrow_arena(tbb::task_arena& arena) {
  auto impl = std::make_unique<Arena::Impl>();
  impl->arena = &arena;
  return Arena(std::move(impl));
}

}  // namespace mapcodec
