// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

namespace mapcodec::daemon {

/// What the client called its request, if that is 1 to 64 letters, digits, '-', '_', '.' or ':' (a log line
/// stays one line); else a new one of 16 hexadecimal digits. Threads: any.
[[nodiscard]] std::string request_id(std::string_view from_client);

}  // namespace mapcodec::daemon
