// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/lzf.hpp"

#include <algorithm>
#include <cstring>

namespace mapcodec {
namespace {

constexpr std::size_t kMaxDistance = 8192, kMaxLength = 264, kMaxLiterals = 32;

std::size_t hash3(const std::uint8_t* p) {
  const std::uint32_t v = std::uint32_t(p[0]) | std::uint32_t(p[1]) << 8 | std::uint32_t(p[2]) << 16;
  return (v * 2654435761u) >> 16;
}

void put_literals(Bytes& out, const std::uint8_t* from, std::size_t count) {
  while (count > 0) {
    const std::size_t n = std::min(count, kMaxLiterals);
    out.push_back(static_cast<std::uint8_t>(n - 1));
    out.insert(out.end(), from, from + n);
    from += n;
    count -= n;
  }
}

void put_match(Bytes& out, std::size_t distance, std::size_t length) {
  const std::size_t d = distance - 1, l = length - 2;
  out.push_back(static_cast<std::uint8_t>(std::min<std::size_t>(l, 7) << 5 | d >> 8));
  if (l >= 7) out.push_back(static_cast<std::uint8_t>(l - 7));
  out.push_back(static_cast<std::uint8_t>(d));
}

}  // namespace

bool lzf_decode(ByteSpan in, std::span<std::uint8_t> out) {
  std::size_t i = 0, o = 0;
  while (i < in.size()) {
    const std::size_t control = in[i++];
    if (control < 32) {
      const std::size_t n = control + 1;
      if (n > in.size() - i || n > out.size() - o) return false;
      std::memcpy(out.data() + o, in.data() + i, n);
      i += n;
      o += n;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) {
      if (i >= in.size()) return false;
      length += in[i++];
    }
    length += 2;
    if (i >= in.size()) return false;
    const std::size_t distance = ((control & 31) << 8 | in[i++]) + 1;
    if (distance > o || length > out.size() - o) return false;
    // Byte by byte: a match may overlap what it makes.
    for (std::size_t k = 0; k < length; ++k, ++o) out[o] = out[o - distance];
  }
  return o == out.size();
}

Bytes lzf_encode(ByteSpan in) {
  Bytes out;
  out.reserve(in.size() / 2);
  std::vector<std::size_t> last(std::size_t{1} << 16, 0);  // position + 1 of the latest such three bytes
  std::size_t i = 0, literal = 0;
  while (i + 2 < in.size()) {
    std::size_t& slot = last[hash3(in.data() + i)];
    const std::size_t candidate = slot;
    slot = i + 1;
    const bool near = candidate > 0 && i + 1 - candidate <= kMaxDistance;
    if (!near || std::memcmp(in.data() + candidate - 1, in.data() + i, 3) != 0) {
      ++i;
      continue;
    }
    const std::size_t from = candidate - 1, limit = std::min(kMaxLength, in.size() - i);
    std::size_t length = 3;
    while (length < limit && in[from + length] == in[i + length]) ++length;
    put_literals(out, in.data() + literal, i - literal);
    put_match(out, i - from, length);
    i += length;
    literal = i;
  }
  put_literals(out, in.data() + literal, in.size() - literal);
  return out;
}

}  // namespace mapcodec
