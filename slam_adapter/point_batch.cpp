// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/point_batch.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

Error bad_channel(const ChannelSchema& c, const std::string& why) {
  return make_error(ErrorCode::kMalformed, "channel '" + c.info.name + "' " + why);
}

Status check_constant(const ChannelSchema& c, const Channel& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::memcmp(values.at(i), c.constant.data(), c.constant.size()) != 0)
      return bad_channel(
          c,
          "is the same for all points of the map, which stores it once for good, and these have "
          "another value: begin another map with them (update --create), and merge this one "
          "into it");
  }
  return {};
}

Result<Channel> channel_for(const ChannelSchema& c, PointCloud& points) {
  Channel* found = points.find(c.info.name);
  const bool same = found != nullptr && found->info == c.info;
  switch (c.kept) {
    case ChannelKept::dropped:
      if (same) return std::move(*found);
      return Channel{c.info, Bytes(c.info.stride() * points.size())};
    case ChannelKept::constant:
      if (!same) break;
      MAPCODEC_TRY(check_constant(c, *found));
      return std::move(*found);
    default:
      if (same) return std::move(*found);
  }
  if (found == nullptr) return bad_channel(c, "is kept by the map and missing here");
  return bad_channel(c, "is " + c.info.type_name() + " in the map and " + found->info.type_name() + " here");
}

PointCloud finite_only(PointCloud points, std::uint64_t& dropped) {
  std::vector<std::uint32_t> keep;
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (is_finite(points.xyz[i])) keep.push_back(i);
  }
  dropped = points.size() - keep.size();
  return dropped == 0 ? std::move(points) : points.gather(keep);
}

}  // namespace

Result<PointCloud> fit_to_schema(PointCloud points, const MapSchema& schema, std::uint64_t& dropped) {
  dropped = 0;
  if (schema.promise == PromiseKind::lossless) {
    if (!(points.coordinates == schema.coordinates))
      return make_error(
          ErrorCode::kInvalidArgument,
          "a lossless map holds coordinates of its first source's type only, and these have another "
          "(a pose makes float32 ones float64)");
  } else {
    points = finite_only(std::move(points), dropped);
  }
  PointCloud fitted;
  fitted.coordinates = schema.coordinates;
  for (const ChannelSchema& c : schema.channels) {
    MAPCODEC_ASSIGN(Channel values, channel_for(c, points));
    fitted.channels.push_back(std::move(values));
  }
  fitted.xyz = std::move(points.xyz);
  return fitted;
}

PointCloud without_dropped(PointCloud points, const MapSchema& schema) {
  std::vector<Channel> kept;
  for (std::size_t i = 0; i < schema.channels.size(); ++i) {
    if (schema.channels[i].kept != ChannelKept::dropped) kept.push_back(std::move(points.channels[i]));
  }
  points.channels = std::move(kept);
  return points;
}

std::vector<std::string> unkept_channels(const PointCloud& layout, const MapSchema& schema) {
  std::vector<std::string> names;
  for (const Channel& c : layout.channels) {
    const bool kept = std::any_of(
        schema.channels.begin(), schema.channels.end(),
        [&](const ChannelSchema& s) { return s.info == c.info && s.kept != ChannelKept::dropped; });
    if (!kept) names.push_back(c.info.name);
  }
  return names;
}

}  // namespace mapcodec
