// SPDX-License-Identifier: GPL-3.0-or-later
// Lines on stderr: for people, or one JSON object each. Always one line, whatever a client puts into it.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <variant>

#include "mapcodec/base/result.hpp"
#include "tools/mapcodecd/request_record.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

enum class LogLevel : std::uint8_t { trace, debug, info, warn, error };

struct LogField {
  std::string_view key;
  std::variant<std::string_view, double, std::int64_t> value;
};

/// From now on the default logger of spdlog writes as `settings` say; what others log through it, too.
/// Errors: InvalidArgument (level).
[[nodiscard]] Status start_logging(const LogSettings& settings);

/// Threads: any.
void log_event(LogLevel level, std::string_view message, std::initializer_list<LogField> fields = {});

/// The line of a request. @param level  info, or debug where requests are not to be seen.
void log_request(const RequestRecord& record, LogLevel level);

}  // namespace mapcodec::daemon
