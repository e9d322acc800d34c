// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/content_hash.hpp"

#define XXH_INLINE_ALL  // header only: nothing to link
#include <xxhash.h>

#include <algorithm>

namespace mapcodec {

std::string ContentHash::to_string() const {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t b : bytes) {
    text += kDigits[b >> 4];
    text += kDigits[b & 15];
  }
  return text;
}

ContentHash hash_bytes(ByteSpan bytes) {
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits(bytes.data(), bytes.size()));
  ContentHash hash;
  std::copy(std::begin(canonical.digest), std::end(canonical.digest), hash.bytes.begin());
  return hash;
}

ContentHash hash_tile(std::uint8_t codec, const std::vector<ContentHash>& segments) {
  Bytes all{codec};
  for (const ContentHash& s : segments) all.insert(all.end(), s.bytes.begin(), s.bytes.end());
  return hash_bytes(all);
}

}  // namespace mapcodec
