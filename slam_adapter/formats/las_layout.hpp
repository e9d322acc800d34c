// SPDX-License-Identifier: GPL-3.0-or-later
// What LAS 1.0 to 1.4 reader and writer share: the point record formats 0 to 10.
#pragma once

#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

inline constexpr unsigned kLasFormats = 11;

/// Bytes of a point record of `format` (0 to 10) without extra bytes.
[[nodiscard]] std::size_t las_record_size(unsigned format);
/// Header bytes of LAS 1.`minor`.
[[nodiscard]] std::size_t las_header_size(unsigned minor);
/// Whether `format` is of the second generation (6 to 10): wider return numbers, flags and angles, always GPS
/// time.
[[nodiscard]] inline bool las_is_wide(unsigned format) {
  return format >= 6;
}

/// Records of `format`, `stride` bytes each: every bit goes to some channel. "scan_flags": bit 0 direction,
/// bit 1 edge of flight line. "class_flags": synthetic, key point, withheld(, overlap) from bit 0. Bytes
/// beyond the format become "extra_bytes" (and _2, ... if more than 255).
[[nodiscard]] RecordPlan las_plan(unsigned format, std::size_t stride, const CoordinateFormat& coordinates);

}  // namespace mapcodec
