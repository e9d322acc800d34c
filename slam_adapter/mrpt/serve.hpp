// SPDX-License-Identifier: GPL-3.0-or-later
// What the program for MRPT's files does: the far end of MessagePipe.
#pragma once

#include <string>

#include "slam_adapter/mrpt/log_reader.hpp"

namespace mapcodec {

/// This process may never use more than this, and leaves no core file. Errors: InvalidArgument.
[[nodiscard]] Status limit_process(std::uint64_t memory_bytes);

/// Writes frames, then the summary or an error, as messages to `fd`. Ends quietly where nobody listens.
void serve_log(const std::string& path, const LogSettings& settings, int fd);

/// Reads frames from `fd` until it ends, writes them as a simplemap, answers with the summary or an error.
void serve_simplemap(const std::string& path, std::uint32_t keyframes, int fd);

}  // namespace mapcodec
