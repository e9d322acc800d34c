// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/mapcodecd/operations/metrics.hpp"

namespace mapcodec::daemon {

/// Memory, processor time, open files and start of this process, under the names that Prometheus' own clients
/// use.
[[nodiscard]] std::vector<GaugeSample> process_figures();

}  // namespace mapcodec::daemon
