// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/verbs/history.hpp"

#include <spdlog/fmt/fmt.h>

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace mapcodec::cli {

std::int64_t commit_time() {
  if (const char* text = std::getenv("SOURCE_DATE_EPOCH")) {
    std::int64_t given = 0;
    const auto [stop, error] = std::from_chars(text, text + std::strlen(text), given);
    if (error == std::errc() && *stop == '\0' && given >= 0) return given;
  }
  return std::time(nullptr);
}

std::string time_text(std::int64_t timestamp_s) {
  const std::time_t time = timestamp_s;
  std::tm parts{};
  char text[32];
  if (timestamp_s == 0 || ::gmtime_r(&time, &parts) == nullptr) return "-";
  if (std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &parts) == 0) return "-";
  return text;
}

std::string shown(const std::string& name, std::size_t width) {
  std::string text;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    text += byte < 0x20 || byte == 0x7F ? '?' : c;
  }
  if (text.size() <= width) return text;
  std::size_t end = width - 2;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;  // not within a character
  return text.substr(0, end) + "..";
}

std::string tile_text(std::uint32_t submap, const TileKey& key) {
  const std::string in = submap == 0 ? "" : fmt::format("{}/ ", submap);
  if (key.is_unplaced()) return in + "unplaced";
  return in + fmt::format("{}: {},{},{}", key.level, key.x, key.y, key.z);
}

Json tile_json(std::uint32_t submap, const TileKey& key) {
  return {{"submap", submap}, {"level", key.level}, {"x", key.x}, {"y", key.y}, {"z", key.z}};
}

std::string names_of(const MapInfo& info, std::uint64_t revision) {
  std::string names;
  for (const Snapshot& s : info.snapshots) {
    if (s.revision == revision) names += (names.empty() ? "" : ", ") + s.name;
  }
  return names;
}

std::string json_text(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace);
}

}  // namespace mapcodec::cli
