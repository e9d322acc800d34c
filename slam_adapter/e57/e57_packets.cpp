// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/e57/e57_packets.hpp"

#include <algorithm>
#include <cstring>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/e57/e57_pages.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kMostPending = std::size_t{64} << 20;
constexpr std::uint8_t kDataPacket = 1;

Error malformed(const char* what, std::uint64_t at) {
  return make_error(ErrorCode::kMalformed, what, at);
}

}  // namespace

E57Packets::E57Packets(const ByteStream& pages, const E57Scan& scan)
    : cursor_(pages), section_(scan.section), streams_(scan.fields.size()) {
  for (std::size_t i = 0; i < streams_.size(); ++i) streams_[i].bits = scan.fields[i].bits();
}

Status E57Packets::open() {
  cursor_.seek(section_);
  const ByteSpan head = cursor_.take(32);
  MAPCODEC_TRY(cursor_.status());
  if (head.size() < 32) return make_error(ErrorCode::kTruncated, "has points of a scan beyond its end");
  ByteReader in(head);
  if (in.u64() % 256 != 1) return malformed("has a scan whose points are no section of E57", section_);
  const std::uint64_t length = in.u64();
  const std::uint64_t data = in.u64();
  if (length > cursor_.left() + 32)
    return make_error(ErrorCode::kTruncated, "has a section beyond its end", section_);
  end_ = section_ + length;
  const std::uint64_t first = E57Pages::logical(data);
  if (first < section_ + 32 || first > end_) return malformed("has a section without packets", section_);
  cursor_.seek(first);
  return {};
}

Status E57Packets::prepare() {
  while (!std::all_of(streams_.begin(), streams_.end(), [](const Stream& s) { return s.ready(); }))
    MAPCODEC_TRY(read_packet());
  return {};
}

std::uint64_t E57Packets::take(std::size_t f) {
  Stream& s = streams_[f];
  std::uint64_t v = 0;
  unsigned got = 0;
  while (got < s.bits) {
    const auto in_byte = static_cast<unsigned>(s.at % 8);
    const unsigned n = std::min(8 - in_byte, s.bits - got);
    const std::uint64_t piece = (s.bytes[s.at / 8] >> in_byte) & ((1u << n) - 1);
    v |= piece << got;
    got += n;
    s.at += n;
  }
  return v;
}

Status E57Packets::read_packet() {
  const std::uint64_t at = cursor_.offset();
  if (at + 4 > end_)
    return make_error(ErrorCode::kTruncated, "has a scan whose packets end before its last point", at);
  const ByteSpan head = cursor_.take(4);
  MAPCODEC_TRY(cursor_.status());
  if (head.size() < 4) return make_error(ErrorCode::kTruncated, "ends within a packet", at);
  const std::uint8_t type = head[0];
  const std::size_t length = std::size_t{head[2]} + 256 * std::size_t{head[3]} + 1;
  if (type > 2 || length < 4 || length > end_ - at) return malformed("has a broken packet of points", at);
  const ByteSpan body = cursor_.take(length - 4);
  MAPCODEC_TRY(cursor_.status());
  if (body.size() < length - 4) return make_error(ErrorCode::kTruncated, "ends within a packet", at);
  return type == kDataPacket ? read_data(body, at) : Status{};
}

Status E57Packets::read_data(ByteSpan packet, std::uint64_t at) {
  ByteReader in(packet);
  if (in.u16() != streams_.size()) return malformed("has a packet with streams for other fields", at);
  std::vector<std::size_t> sizes(streams_.size());
  for (std::size_t& s : sizes) s = in.u16();
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const ByteSpan piece = in.raw(sizes[i]);
    Stream& s = streams_[i];
    s.bytes.erase(s.bytes.begin(), s.bytes.begin() + static_cast<std::ptrdiff_t>(s.at / 8));
    s.at %= 8;
    if (s.bits > 0) s.bytes.insert(s.bytes.end(), piece.begin(), piece.end());
    if (s.bytes.size() > kMostPending)
      return make_error(ErrorCode::kLimitExceeded, "has fields of one point more than 64 MiB apart", at);
  }
  return in.ok() ? Status{} : malformed("has a packet whose streams do not fit in it", at);
}

}  // namespace mapcodec
