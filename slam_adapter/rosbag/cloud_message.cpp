// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/cloud_message.hpp"

#include "slam_adapter/formats/byte_order.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kMostPoints = std::uint64_t{1} << 26;

Result<RecordPlan> plan_of(const RosCloud& message) {
  std::vector<RecordField> fields = message.fields;
  for (RecordField& f : fields) {
    if (f.name.empty()) f.name = "_";
  }
  auto plan = RecordPlan::from_fields(fields, message.point_step, true);
  if (!plan.ok()) return make_error(plan.error().code, "a PointCloud2: " + plan.error().message);
  return plan;
}

/// `count` records, decoded; big-endian ones by way of a copy.
void decode_rows(const RosCloud& m, const RecordPlan& plan, std::size_t at, std::size_t count,
                 PointCloud& block) {
  const std::uint8_t* rows = m.data.data() + at;
  if (!m.big_endian) return plan.decode(rows, count, block);
  Bytes swapped(rows, rows + count * m.point_step);
  swap_fields(m.fields, m.point_step, swapped.data(), count);
  plan.decode(swapped.data(), count, block);
}

const Channel* find_same(const PointCloud& cloud, const ChannelInfo& info) {
  const Channel* c = cloud.find(info.name);
  return c != nullptr && c->info == info ? c : nullptr;
}

}  // namespace

Result<PointCloud> cloud_layout(const RosCloud& message) {
  MAPCODEC_ASSIGN(RecordPlan plan, plan_of(message));
  return std::move(plan.layout);
}

Result<PointCloud> decode_cloud(const RosCloud& message) {
  MAPCODEC_ASSIGN(const RecordPlan plan, plan_of(message));
  const std::uint64_t points = std::uint64_t{message.width} * message.height;
  if (points > kMostPoints)
    return make_error(ErrorCode::kLimitExceeded,
                      "a PointCloud2 has " + std::to_string(points) + " points; at most 67,108,864 are read");
  PointCloud cloud = plan.layout.like();
  if (points == 0) return cloud;
  const bool padded = message.height > 1 && message.row_step != message.width * message.point_step;
  if (!padded) {
    decode_rows(message, plan, 0, points, cloud);
    return cloud;
  }
  PointCloud row = plan.layout.like();
  for (std::uint32_t r = 0; r < message.height; ++r) {
    decode_rows(message, plan, std::size_t{r} * message.row_step, message.width, row);
    cloud.append(row);
  }
  return cloud;
}

PointCloud common_layout(const std::vector<PointCloud>& layouts, const std::vector<std::string>& names,
                         std::vector<std::string>& warnings) {
  PointCloud r = layouts.front().like();
  for (const PointCloud& other : layouts) {
    std::erase_if(r.channels, [&](const Channel& c) { return find_same(other, c.info) == nullptr; });
    if (other.coordinates != r.coordinates)
      r.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
  }
  for (std::size_t i = 0; i < layouts.size(); ++i) {
    for (const Channel& c : layouts[i].channels) {
      if (find_same(r, c.info) == nullptr)
        warnings.push_back(names[i] + ": the channel " + c.info.name + " (" + c.info.type_name() +
                           ") is not kept, since other topics lack it");
    }
  }
  return r;
}

bool conform(PointCloud& cloud, const PointCloud& layout) {
  if (cloud.coordinates != layout.coordinates && layout.coordinates.kind != CoordinateFormat::Kind::f64)
    return false;
  cloud.coordinates = layout.coordinates;
  std::vector<Channel> channels;
  for (const Channel& wanted : layout.channels) {
    Channel* c = cloud.find(wanted.info.name);
    if (c == nullptr || c->info != wanted.info) return false;
    channels.push_back(std::move(*c));
  }
  cloud.channels = std::move(channels);
  return true;
}

}  // namespace mapcodec
