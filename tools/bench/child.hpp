// SPDX-License-Identifier: GPL-3.0-or-later
// Programs that a measurement runs.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "tools/bench/machine.hpp"

namespace mapcodec::bench {

/// Runs a program and waits. @param words  its path, then its arguments. @return what it wrote to its
/// standard output. Errors: Unreadable (it could not be started, or failed).
[[nodiscard]] Result<std::string> output_of(std::vector<std::string> words);

/// The last line of its output as JSON, or all of it. Errors: also Malformed.
[[nodiscard]] Result<Json> json_of(std::vector<std::string> words);

/// Path of the program that runs.
[[nodiscard]] std::string own_path();

}  // namespace mapcodec::bench
