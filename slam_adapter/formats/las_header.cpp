// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/las_header.hpp"

#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/formats/cursor.hpp"
#include "slam_adapter/formats/las_layout.hpp"

namespace mapcodec {
namespace {

Error malformed(const std::string& what, std::uint64_t at) {
  return make_error(ErrorCode::kMalformed, what, at);
}

void read_tail_fields(ByteReader in, LasHeader& h) {
  if (h.minor < 3 || h.header_size < las_header_size(3)) return;
  in.raw(227);
  h.may_have_tail = in.u64() != 0;  // start of waveform data
  if (h.minor < 4 || h.header_size < las_header_size(4)) return;
  const std::uint64_t extended_at = in.u64();
  const std::uint32_t extended = in.u32();
  const std::uint64_t points = in.u64();
  h.may_have_tail = h.may_have_tail || (extended_at != 0 && extended > 0);
  if (points != 0) h.points = points;
}

LasHeader read_fields(ByteSpan bytes) {
  LasHeader h;
  ByteReader in(bytes);
  in.raw(25);
  h.minor = in.u8();
  in.raw(68);
  h.header_size = in.u16();
  h.data_offset = in.u32();
  h.records = in.u32();
  h.format = in.u8();
  h.compressed = (h.format & 0xC0) != 0;
  h.format &= 0x3F;
  h.stride = in.u16();
  h.points = in.u32();
  in.raw(20);
  for (double& v : h.coordinates.scale) v = in.f64();
  for (double& v : h.coordinates.offset) v = in.f64();
  read_tail_fields(ByteReader(bytes), h);
  return h;
}

Status check_numbers(const LasHeader& h) {
  for (std::size_t d = 0; d < 3; ++d) {
    const double s = h.coordinates.scale[d], o = h.coordinates.offset[d];
    if (!(s > 0) || !std::isfinite(s))
      return malformed("the LAS header has a scale that is not positive", 131 + 8 * d);
    if (!std::isfinite(o)) return malformed("the LAS header has an offset that is not finite", 155 + 8 * d);
  }
  return {};
}

Status check_header(const LasHeader& h, std::uint64_t file_size) {
  const auto text = [](std::uint64_t v) { return std::to_string(v); };
  if (h.format >= kLasFormats)
    return malformed("LAS point format " + text(h.format) + " does not exist", 104);
  if (h.header_size < las_header_size(h.minor))
    return malformed("LAS 1." + text(h.minor) + " with a header of only " + text(h.header_size) + " bytes",
                     94);
  if (h.data_offset < h.header_size || h.data_offset > file_size) {
    return malformed("points begin at byte " + text(h.data_offset) + " of " + text(file_size) +
                         ", after a header of " + text(h.header_size),
                     96);
  }
  if (h.stride < las_record_size(h.format)) {
    return malformed(
        "point records of " + text(h.stride) + " bytes are too short for format " + text(h.format), 105);
  }
  if (h.points == 0) return make_error(ErrorCode::kEmpty, "holds no point (the LAS header announces 0)");
  return check_numbers(h);
}

}  // namespace

Result<LasHeader> read_las_header(const ByteStream& stream) {
  Cursor cursor(stream);
  const ByteSpan head = cursor.take(las_header_size(4));
  MAPCODEC_TRY(cursor.status());
  if (head.size() < las_header_size(2)) {
    return make_error(ErrorCode::kTruncated,
                      "ends within the LAS header (" + std::to_string(head.size()) + " of 227 bytes)",
                      head.size());
  }
  if (head[24] != 1 || head[25] > 4) {
    return make_error(
        ErrorCode::kUnsupported,
        "is LAS " + std::to_string(head[24]) + "." + std::to_string(head[25]) + "; 1.0 to 1.4 are read", 24);
  }
  const LasHeader h = read_fields(head);
  MAPCODEC_TRY(check_header(h, stream.size()));
  return h;
}

}  // namespace mapcodec
