// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/duration_text.hpp"

#include <charconv>
#include <ctime>

namespace mapcodec::daemon {

std::optional<std::int64_t> parse_duration(std::string_view text) {
  constexpr std::int64_t kDay = 86400, kMost = 36525 * kDay;
  std::int64_t count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc{} || end + 1 != text.data() + text.size() || count < 1) return std::nullopt;
  const std::int64_t unit = *end == 's' ? 1 : *end == 'm' ? 60 : *end == 'h' ? 3600 : *end == 'd' ? kDay : 0;
  if (unit == 0 || count > kMost / unit) return std::nullopt;
  return count * unit;
}

std::string date_text(std::int64_t seconds_since_epoch) {
  if (seconds_since_epoch == 0) return "never";
  const auto time = static_cast<std::time_t>(seconds_since_epoch);
  std::tm utc{};
  char text[32];
  if (gmtime_r(&time, &utc) == nullptr) return "?";
  return {text, std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &utc)};
}

}  // namespace mapcodec::daemon
