// SPDX-License-Identifier: GPL-3.0-or-later
// The one shape of all pipelines here: serial in, parallel work, serial out in the order of the input.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>

#include "mapcodec/base/result.hpp"
#include "parallel/arena.hpp"

namespace mapcodec {

/// The stages of a pipeline whose items live in numbered slots. A slot belongs to one item from its `feed` to
/// its `drain`, so what stands in it needs no lock.
struct OrderedStages {
  std::function<Result<bool>(std::size_t slot)> feed;  ///< fills the slot; false: no more. One call at a time
  std::function<Status(std::size_t slot)> work;        ///< many at a time
  std::function<Status(std::size_t slot)> drain;       ///< one at a time, in the order of feeding
};

/// Runs the stages until `feed` says false or something fails.
/// @param arena  nullptr: all on the caller's thread.
/// @param slots  items in flight at most, at least 1.
/// @param stop   set it from anywhere to end early.
/// @param what   names the work in errors that come from exceptions.
/// Errors: that of the first item, in the order of feeding, which failed (no later one is drained), whatever
/// the number of threads; Cancelled; LimitExceeded when memory runs out. What the stages throw is caught.
[[nodiscard]] Status run_ordered(Arena* arena, std::size_t slots, const OrderedStages& stages,
                                 const std::atomic<bool>* stop, const char* what);

}  // namespace mapcodec
