// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/tile_path.hpp"

#include <charconv>
#include <limits>

namespace mapcodec::daemon {
namespace {

constexpr std::size_t kMostCharacters = 64;

/// The numbers between underscores; the rest of the list stays 0. @return how many; 0: not only numbers, or
/// more than five.
std::size_t parse_numbers(std::string_view text, std::int64_t (&numbers)[5]) {
  for (std::size_t count = 0; count < 5; ++count) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), numbers[count]);
    if (error != std::errc{}) return 0;
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    if (text.empty()) return count + 1;
    if (text[0] != '_') return 0;
    text.remove_prefix(1);
  }
  return 0;
}

template <class Integer>
bool fits(std::int64_t value) {
  return value >= std::numeric_limits<Integer>::min() && value <= std::numeric_limits<Integer>::max();
}

}  // namespace

std::string tile_path(const TileSelection::Key& key) {
  const std::string submap = key.submap == 0 ? "" : std::to_string(key.submap) + "_";
  return submap + std::to_string(key.key.level) + "_" + std::to_string(key.key.x) + "_" +
         std::to_string(key.key.y) + "_" + std::to_string(key.key.z);
}

std::optional<TileSelection::Key> parse_tile_path(std::string_view text) {
  std::int64_t n[5] = {};
  const std::size_t count = text.size() <= kMostCharacters ? parse_numbers(text, n) : 0;
  if (count < 4) return std::nullopt;
  const std::int64_t submap = count == 5 ? n[0] : 0;
  const std::int64_t* k = count == 5 ? n + 1 : n;
  if (!fits<std::uint32_t>(submap) || !fits<std::uint8_t>(k[0])) return std::nullopt;
  for (int i = 1; i < 4; ++i) {
    if (!fits<std::int32_t>(k[i])) return std::nullopt;
  }
  const TileSelection::Key key{static_cast<std::uint32_t>(submap),
                               {static_cast<std::int32_t>(k[1]), static_cast<std::int32_t>(k[2]),
                                static_cast<std::int32_t>(k[3]), static_cast<std::uint8_t>(k[0])}};
  if (tile_path(key) != text) return std::nullopt;  // one name for one tile: no leading zeros, no "-0"
  return key;
}

}  // namespace mapcodec::daemon
