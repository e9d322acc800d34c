// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/resampled_channels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace mapcodec {
namespace {

constexpr std::array<std::string_view, 22> kOfOneRay{"time",
                                                     "gps_time",
                                                     "timestamp",
                                                     "t",
                                                     "ring",
                                                     "line",
                                                     "laser_id",
                                                     "channel",
                                                     "point_id",
                                                     "point_index",
                                                     "scan_angle",
                                                     "scan_angle_rank",
                                                     "return_number",
                                                     "number_of_returns",
                                                     "echo_type",
                                                     "range",
                                                     "azimuth",
                                                     "row",
                                                     "column",
                                                     "scan_direction_flag",
                                                     "edge_of_flight_line",
                                                     "time_offset"};
// Values that mean nothing between each other.
constexpr std::array<std::string_view, 9> kNames{"label",           "classification", "class",
                                                 "segment",         "instance",       "cluster",
                                                 "point_source_id", "user_data",      "flags"};
constexpr double kShareOfRange = 1.0 / 64;

template <std::size_t N>
bool is_one_of(const std::array<std::string_view, N>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

double value_at(const Channel& c, std::size_t i, std::size_t k) {
  switch (c.info.scalar) {
    case ScalarType::u8:
      return c.get<std::uint8_t>(i, k);
    case ScalarType::i8:
      return c.get<std::int8_t>(i, k);
    case ScalarType::u16:
      return c.get<std::uint16_t>(i, k);
    case ScalarType::i16:
      return c.get<std::int16_t>(i, k);
    case ScalarType::u32:
      return c.get<std::uint32_t>(i, k);
    case ScalarType::i32:
      return c.get<std::int32_t>(i, k);
    case ScalarType::u64:
      return static_cast<double>(c.get<std::uint64_t>(i, k));
    case ScalarType::i64:
      return static_cast<double>(c.get<std::int64_t>(i, k));
    case ScalarType::f32:
      return static_cast<double>(c.get<float>(i, k));
    case ScalarType::f64:
      return c.get<double>(i, k);
  }
  return 0;
}

/// Between the first and the last thousandth, so that a few wild values do not make the bound worthless; over
/// all components. 0 where there is no finite value.
double range_on(const TileSample& sample, std::size_t channel) {
  std::vector<double> values;
  for (const PointCloud& piece : sample.pieces) {
    const Channel& c = piece.channels[channel];
    for (std::size_t i = 0; i < c.size(); i += 7) {
      for (std::size_t k = 0; k < c.info.components; ++k) {
        const double v = value_at(c, i, k);
        if (std::isfinite(v)) values.push_back(v);
      }
    }
  }
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t margin = values.size() / 1000;
  return values[values.size() - 1 - margin] - values[margin];
}

std::string says_bound(const ChannelSchema& c) {
  char text[64];
  std::snprintf(text, sizeof text, "%.3g", c.bound);
  return "channel '" + c.info.name + "' is kept within " + text +
         " of the nearest original (--max-error keeps every value)";
}

}  // namespace

std::vector<ChannelSchema> resampled_channels(const MapSchema& schema, const TileSample& sample,
                                              std::vector<std::string>& warnings) {
  std::vector<ChannelSchema> channels = schema.channels;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    ChannelSchema& c = channels[i];
    if (c.kept != ChannelKept::exact || c.info.name == "rgb" || is_one_of(kNames, c.info.name)) continue;
    if (is_one_of(kOfOneRay, c.info.name)) {
      c.kept = ChannelKept::dropped;
      warnings.push_back("channel '" + c.info.name +
                         "' is not kept: resampled points have none (--max-error keeps it)");
      continue;
    }
    const double bound = kShareOfRange * range_on(sample, i);
    if (!(bound > 0)) continue;
    c.kept = ChannelKept::bounded;
    c.bound = bound;
    warnings.push_back(says_bound(c));
  }
  return channels;
}

}  // namespace mapcodec
