// SPDX-License-Identifier: GPL-3.0-or-later
// The door at which exceptions of std and TBB become Errors.
#pragma once

#include <atomic>
#include <exception>
#include <new>
#include <string>
#include <utility>

#include "mapcodec/base/result.hpp"

namespace mapcodec::parallel_detail {

/// The result of `f()`, which returns a Result or Status; what it throws becomes an Error that names `what`.
template <class F>
auto guarded(const char* what, F&& f) -> decltype(f()) {
  try {
    return std::forward<F>(f)();
  } catch (const std::bad_alloc&) {
    return make_error(ErrorCode::kLimitExceeded, std::string(what) + ": not enough memory");
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string(what) + ": " + e.what());
  } catch (...) {
    return make_error(ErrorCode::kInvalidArgument, std::string(what) + ": unknown exception");
  }
}

[[nodiscard]] inline bool stop_asked(const std::atomic<bool>* stop) {
  return stop != nullptr && stop->load(std::memory_order_relaxed);
}
[[nodiscard]] inline Error cancelled(const char* what) {
  return make_error(ErrorCode::kCancelled, std::string(what) + " was cancelled");
}

}  // namespace mapcodec::parallel_detail
