// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace mapcodec::daemon {

/// "90s", "15m", "12h", "30d" -> seconds, at most 100 years; nothing for anything else.
[[nodiscard]] std::optional<std::int64_t> parse_duration(std::string_view text);

/// "2026-11-27 00:00:00"; "never" for 0. UTC.
[[nodiscard]] std::string date_text(std::int64_t seconds_since_epoch);

}  // namespace mapcodec::daemon
