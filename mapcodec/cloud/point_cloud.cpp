// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

const Channel* PointCloud::find(std::string_view name) const {
  for (const Channel& c : channels) {
    if (c.info.name == name) return &c;
  }
  return nullptr;
}

Channel* PointCloud::find(std::string_view name) {
  return const_cast<Channel*>(std::as_const(*this).find(name));
}

PointCloud PointCloud::like() const {
  PointCloud r;
  r.coordinates = coordinates;
  for (const Channel& c : channels) r.channels.push_back({c.info, {}});
  return r;
}

void PointCloud::resize(std::size_t count) {
  xyz.resize(count);
  for (Channel& c : channels) c.data.resize(count * c.info.stride());
}

void PointCloud::append(const PointCloud& other, std::size_t begin, std::size_t end) {
  using Offset = std::ptrdiff_t;
  xyz.insert(xyz.end(), other.xyz.begin() + Offset(begin), other.xyz.begin() + Offset(end));
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const Bytes& from = other.channels[c].data;
    const std::size_t stride = channels[c].info.stride();
    channels[c].data.insert(channels[c].data.end(), from.begin() + Offset(begin * stride),
                            from.begin() + Offset(end * stride));
  }
}

PointCloud PointCloud::gather(const std::vector<std::uint32_t>& order) const {
  PointCloud r = like();
  r.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) r.xyz[i] = xyz[order[i]];
  for (std::size_t c = 0; c < channels.size(); ++c) {
    const std::size_t stride = channels[c].info.stride();
    for (std::size_t i = 0; i < order.size(); ++i)
      std::memcpy(r.channels[c].at(i), channels[c].at(order[i]), stride);
  }
  return r;
}

Box PointCloud::bounds() const {
  Box b;
  for (const Vec3& p : xyz) {
    if (is_finite(p)) b.add(p);
  }
  return b;
}

}  // namespace mapcodec
