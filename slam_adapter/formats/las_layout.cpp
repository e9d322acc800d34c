// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/las_layout.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

bool has_gps(unsigned f) {
  return f == 1 || f >= 3;
}
bool has_rgb(unsigned f) {
  return f == 2 || f == 3 || f == 5 || f == 7 || f == 8 || f == 10;
}
bool has_nir(unsigned f) {
  return f == 8 || f == 10;
}
bool has_wave(unsigned f) {
  return f == 4 || f == 5 || f == 9 || f == 10;
}

void add_narrow_flags(RecordPlan& plan) {
  plan.add_bits("return_number", 14, 0, 7);
  plan.add_bits("number_of_returns", 14, 3, 7);
  plan.add_bits("scan_flags", 14, 6, 3);
  plan.add_bits("classification", 15, 0, 31);
  plan.add_bits("class_flags", 15, 5, 7);
  plan.add_channel({"scan_angle", ScalarType::i8, 1}, 16);
  plan.add_channel({"user_data", ScalarType::u8, 1}, 17);
  plan.add_channel({"point_source_id", ScalarType::u16, 1}, 18);
}

void add_wide_flags(RecordPlan& plan) {
  plan.add_bits("return_number", 14, 0, 15);
  plan.add_bits("number_of_returns", 14, 4, 15);
  plan.add_bits("class_flags", 15, 0, 15);
  plan.add_bits("scanner_channel", 15, 4, 3);
  plan.add_bits("scan_flags", 15, 6, 3);
  plan.add_channel({"classification", ScalarType::u8, 1}, 16);
  plan.add_channel({"user_data", ScalarType::u8, 1}, 17);
  plan.add_channel({"scan_angle", ScalarType::i16, 1}, 18);
  plan.add_channel({"point_source_id", ScalarType::u16, 1}, 20);
}

void add_extra_bytes(RecordPlan& plan, std::size_t offset) {
  for (int i = 1; offset < plan.stride; ++i) {
    const std::size_t n = std::min<std::size_t>(plan.stride - offset, 255);
    plan.add_channel({i == 1 ? "extra_bytes" : "extra_bytes_" + std::to_string(i), ScalarType::u8,
                      static_cast<std::uint8_t>(n)},
                     offset);
    offset += n;
  }
}

}  // namespace

std::size_t las_record_size(unsigned format) {
  constexpr std::size_t kSizes[kLasFormats] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
  return kSizes[format];
}

std::size_t las_header_size(unsigned minor) {
  return minor >= 4 ? 375 : minor == 3 ? 235 : 227;
}

RecordPlan las_plan(unsigned format, std::size_t stride, const CoordinateFormat& coordinates) {
  RecordPlan plan;
  plan.stride = stride;
  plan.layout.coordinates = coordinates;
  for (std::size_t d = 0; d < 3; ++d) plan.axes[d] = {ScalarType::i32, 4 * d};
  plan.add_channel({"intensity", ScalarType::u16, 1}, 12);
  las_is_wide(format) ? add_wide_flags(plan) : add_narrow_flags(plan);
  std::size_t at = las_is_wide(format) ? 22 : 20;
  const auto add = [&](bool there, const ChannelInfo& info) {
    if (!there) return;
    plan.add_channel(info, at);
    at += info.stride();
  };
  add(has_gps(format), {"gps_time", ScalarType::f64, 1});
  add(has_rgb(format), {"rgb", ScalarType::u16, 3});
  add(has_nir(format), {"nir", ScalarType::u16, 1});
  add(has_wave(format), {"wave_packet", ScalarType::u8, 29});
  add_extra_bytes(plan, at);
  return plan;
}

}  // namespace mapcodec
