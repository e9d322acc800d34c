// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/column_codec.hpp"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <limits>

namespace mapcodec {
namespace {

constexpr std::uint8_t kPackedFromZero = 0x40;    // form 0x40 + w: packed, w = 1..63, least = 0
constexpr std::uint8_t kPlanes = 0x80;            // form 0x80 + k: k byte planes in a zstd frame
constexpr std::size_t kLeastForZstd = 16;         // fewer values never pay for a frame
constexpr std::size_t kSlowLevelUpTo = 1u << 18;  // bytes that deserve zstd's slow levels
constexpr std::uint8_t kZstdMagic[] = {0x28, 0xB5, 0x2F, 0xFD};  // of every frame, so not stored

using Values = std::span<const std::uint64_t>;

Error malformed(const char* what, const ByteReader& in) {
  return make_error(ErrorCode::kMalformed, std::string("index column: ") + what, in.offset());
}

Bytes pack(Values values, std::uint64_t least, unsigned width) {
  Bytes out((values.size() * width + 7) / 8);
  std::size_t bit = 0;
  for (const std::uint64_t value : values) {
    for (unsigned i = 0; i < width; ++i, ++bit) {
      if (((value - least) >> i) & 1) out[bit / 8] |= static_cast<std::uint8_t>(1u << (bit % 8));
    }
  }
  return out;
}

std::uint64_t unpack_one(ByteSpan bytes, std::size_t bit, unsigned width) {
  std::uint64_t value = 0;
  for (unsigned done = 0; done < width;) {
    const unsigned shift = (bit + done) % 8;
    const unsigned take = std::min(8 - shift, width - done);
    const std::uint64_t part = (bytes[(bit + done) / 8] >> shift) & ((1u << take) - 1);
    value |= part << done;
    done += take;
  }
  return value;
}

Bytes split_planes(Values values, std::uint64_t least, unsigned planes) {
  Bytes out;
  out.reserve(values.size() * planes);
  for (unsigned p = 0; p < planes; ++p) {
    for (const std::uint64_t value : values)
      out.push_back(static_cast<std::uint8_t>((value - least) >> (8 * p)));
  }
  return out;
}

/// A zstd frame without its magic; empty if zstd fails.
Bytes deflate(ByteSpan bytes) {
  Bytes frame(ZSTD_compressBound(bytes.size()));
  const int level = bytes.size() <= kSlowLevelUpTo ? 19 : 6;
  const std::size_t n = ZSTD_compress(frame.data(), frame.size(), bytes.data(), bytes.size(), level);
  if (ZSTD_isError(n) || n < std::size(kZstdMagic)) return {};
  return Bytes(frame.begin() + std::size(kZstdMagic), frame.begin() + static_cast<std::ptrdiff_t>(n));
}

/// Exactly `size` bytes, or nothing. One call with a known size: zstd allocates no window of its own.
Bytes inflate(ByteSpan stored, std::size_t size) {
  Bytes frame(std::begin(kZstdMagic), std::end(kZstdMagic));
  frame.insert(frame.end(), stored.begin(), stored.end());
  if (ZSTD_getFrameContentSize(frame.data(), frame.size()) != size) return {};
  Bytes bytes(size);
  const std::size_t n = ZSTD_decompress(bytes.data(), bytes.size(), frame.data(), frame.size());
  return ZSTD_isError(n) || n != size ? Bytes{} : bytes;
}

ByteWriter packed_column(Values values, std::uint64_t low, std::uint64_t high) {
  const auto width = static_cast<unsigned>(std::bit_width(high - low)),
             full = static_cast<unsigned>(std::bit_width(high));
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(width));
  out.varint(low);
  out.raw(pack(values, low, width));
  if (full == 0 || full > 63) return out;
  ByteWriter from_zero;
  from_zero.u8(static_cast<std::uint8_t>(kPackedFromZero + full));
  from_zero.raw(pack(values, 0, full));
  return from_zero.size() < out.size() ? from_zero : out;
}

/// Empty where there is nothing to gain.
ByteWriter plane_column(Values values, std::uint64_t low, std::uint64_t high) {
  const unsigned planes = (static_cast<unsigned>(std::bit_width(high - low)) + 7) / 8;
  ByteWriter out;
  if (values.size() < kLeastForZstd || planes == 0) return out;
  const Bytes frame = deflate(split_planes(values, low, planes));
  if (frame.empty()) return out;
  out.u8(static_cast<std::uint8_t>(kPlanes + planes));
  out.varint(low);
  out.sized(frame);
  return out;
}

Status add_least(std::vector<std::uint64_t>& values, std::uint64_t least, const ByteReader& in) {
  for (std::uint64_t& value : values) {
    if (value > std::numeric_limits<std::uint64_t>::max() - least)
      return malformed("a value is too large", in);
    value += least;
  }
  return {};
}

Status read_packed(ByteReader& in, unsigned width, std::vector<std::uint64_t>& values) {
  const ByteSpan bytes = in.raw((std::uint64_t{values.size()} * width + 7) / 8);
  MAPCODEC_TRY(in.status("index column"));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = unpack_one(bytes, i * width, width);
  return {};
}

Status read_planes(ByteReader& in, unsigned planes, std::vector<std::uint64_t>& values) {
  const ByteSpan stored = in.sized();
  MAPCODEC_TRY(in.status("index column"));
  const Bytes bytes = inflate(stored, values.size() * planes);
  if (bytes.empty()) return malformed("broken zstd frame", in);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    values[i % values.size()] |= std::uint64_t{bytes[i]} << (8 * (i / values.size()));
  }
  return {};
}

}  // namespace

void write_column(ByteWriter& out, Values values) {
  if (values.empty()) return;
  if (values.size() == 1) return out.varint(values[0]);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  ByteWriter best = packed_column(values, *low, *high);
  if (ByteWriter planes = plane_column(values, *low, *high); planes.size() > 0 && planes.size() < best.size())
    std::swap(best, planes);
  out.raw(best.bytes());
}

Result<std::vector<std::uint64_t>> read_column(ByteReader& in, std::size_t count) {
  std::vector<std::uint64_t> values(count);
  if (count == 0) return values;
  if (count == 1) {
    values[0] = in.varint();
    MAPCODEC_TRY(in.status("index column"));
    return values;
  }
  const std::uint8_t form = in.u8();
  const bool from_zero = form > kPackedFromZero && form < kPlanes;
  const std::uint64_t least = from_zero ? 0 : in.varint();
  MAPCODEC_TRY(in.status("index column"));
  if (form == kPlanes || form > kPlanes + 8) return malformed("unknown form", in);
  if (form > kPlanes) {
    MAPCODEC_TRY(read_planes(in, form - kPlanes, values));
  } else {
    MAPCODEC_TRY(read_packed(in, from_zero ? form - kPackedFromZero : form, values));
  }
  MAPCODEC_TRY(add_least(values, least, in));
  return values;
}

}  // namespace mapcodec
