// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/order_source.hpp"

#include "slam_adapter/map_file.hpp"

namespace mapcodec {

OrderSource::OrderSource(PointSource& source) : source_(source), layout_(source.layout()) {
  layout_.channels.push_back({{kOrderChannel, ScalarType::u64, 1}, {}});
}

Result<bool> OrderSource::next(PointCloud& block) {
  MAPCODEC_ASSIGN(const bool more, source_.next(block));
  Channel order{layout_.channels.back().info, Bytes(block.size() * sizeof(std::uint64_t))};
  for (std::size_t i = 0; i < block.size(); ++i) order.set<std::uint64_t>(i, next_++);
  block.channels.push_back(std::move(order));
  return more;
}

Status OrderSource::rewind() {
  next_ = 0;
  return source_.rewind();
}

}  // namespace mapcodec
