// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of mapcodecd put together: opens the maps, serves them, and ends in order.
#pragma once

#include <atomic>

#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// Serves until `stop` becomes true, then drains: health says NOT_SERVING, running calls end, what is queued
/// is committed. Logs to stderr.
/// Errors: those of MapService::open and GrpcServer::start.
[[nodiscard]] Status run(const DaemonSettings& settings, const std::atomic<bool>& stop);

}  // namespace mapcodec::daemon
