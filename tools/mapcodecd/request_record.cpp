// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/request_record.hpp"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <random>

namespace mapcodec::daemon {
namespace {

bool is_plain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
         c == '.' || c == ':';
}

/// SplitMix64 [Steele 2014] of a counter that starts anywhere: different for all requests, which is all that
/// is asked.
std::uint64_t next_number() {
  static std::atomic<std::uint64_t> counter{std::random_device{}() * std::uint64_t{0x100000001}};
  std::uint64_t z = counter.fetch_add(0x9E3779B97F4A7C15u);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

}  // namespace

std::string request_id(std::string_view from_client) {
  constexpr std::size_t kMostCharacters = 64;
  if (!from_client.empty() && from_client.size() <= kMostCharacters &&
      std::all_of(from_client.begin(), from_client.end(), is_plain)) {
    return std::string(from_client);
  }
  constexpr const char* kDigits = "0123456789abcdef";
  std::string id;
  for (std::uint64_t number = next_number(), i = 0; i < 16; ++i, number >>= 4) id += kDigits[number & 15];
  return id;
}

}  // namespace mapcodec::daemon
