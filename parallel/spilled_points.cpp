// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/spilled_points.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <mutex>
#include <numeric>

#include "parallel/memory_share.hpp"

namespace mapcodec {
namespace {

bool fits_float(double v) {
  return std::bit_cast<std::uint64_t>(static_cast<double>(static_cast<float>(v))) ==
         std::bit_cast<std::uint64_t>(v);
}

/// True if a coordinate of `points` would lose bits as a float.
bool needs_double(const std::vector<Vec3>& points, Runner& runner) {
  std::atomic<bool> wide{false};
  runner.run(points.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      if (fits_float(points[i][0]) && fits_float(points[i][1]) && fits_float(points[i][2])) continue;
      wide.store(true, std::memory_order_relaxed);
      return;
    }
  });
  return wide;
}

template <class Scalar>
std::uint8_t* put_xyz(const PointCloud& cloud, std::span<const std::uint32_t> order, std::uint8_t* out) {
  for (const std::uint32_t i : order) {
    const Vec3& p = cloud.xyz[i];
    const Scalar v[3] = {static_cast<Scalar>(p[0]), static_cast<Scalar>(p[1]), static_cast<Scalar>(p[2])};
    std::memcpy(out, v, sizeof(v));
    out += sizeof(v);
  }
  return out;
}

template <class Scalar>
const std::uint8_t* get_xyz(const std::uint8_t* in, std::uint32_t points, std::vector<Vec3>& xyz) {
  for (std::uint32_t i = 0; i < points; ++i) {
    Scalar v[3];
    std::memcpy(v, in, sizeof(v));
    in += sizeof(v);
    xyz.push_back({static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2])});
  }
  return in;
}

/// The points at `order` of `cloud`, as a chunk holds them.
void serialize(const PointCloud& cloud, std::span<const std::uint32_t> order, bool wide, Bytes& bytes) {
  std::uint8_t* out = bytes.data();
  out = wide ? put_xyz<double>(cloud, order, out) : put_xyz<float>(cloud, order, out);
  for (const Channel& c : cloud.channels) {
    const std::size_t stride = c.info.stride();
    for (const std::uint32_t i : order) {
      std::memcpy(out, c.at(i), stride);
      out += stride;
    }
  }
}

/// The first error among those that several threads meet.
class SharedStatus {
 public:
  void set(const Status& s) {
    if (s.ok()) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (status_.ok()) status_ = s;
    failed_ = true;
  }
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] const Status& get() const { return status_; }

 private:
  std::mutex mutex_;
  std::atomic<bool> failed_{false};
  Status status_;
};

}  // namespace

void SpilledPoints::begin(const TilePlan& plan, Runner& runner, std::uint64_t memory_budget_bytes) {
  plan_ = &plan;
  runner_ = &runner;
  const std::uint64_t fit = points_sorted_at_once(layout_, memory_budget_bytes);
  batch_points_ = std::max<std::uint64_t>(1, std::min(fit, plan.points()));
  batch_ = layout_;
  batch_.xyz.reserve(batch_points_);
  for (Channel& c : batch_.channels) c.data.reserve(batch_points_ * c.info.stride());
}

Status SpilledPoints::add(const PointCloud& block) {
  for (std::size_t begin = 0; begin < block.size();) {
    const std::size_t end = std::min(block.size(), begin + batch_points_ - batch_.size());
    batch_.append(block, begin, end);
    if (batch_.size() == batch_points_) MAPCODEC_TRY(flush());
    begin = end;
  }
  return {};
}

Status SpilledPoints::flush() {
  MAPCODEC_ASSIGN(const TileOrder order, sort_by_tile(batch_.xyz, *plan_, *runner_));
  const bool wide = needs_double(batch_.xyz, *runner_);
  MAPCODEC_TRY(write_runs(order, wide));
  list_chunks(order, wide);
  batch_.resize(0);
  return {};
}

Status SpilledPoints::write_runs(const TileOrder& order, bool wide) {
  SharedStatus status;
  runner_->run(order.runs.size(), [&](std::size_t begin, std::size_t end) {
    Bytes bytes;
    for (std::size_t r = begin; r < end && !status.failed(); ++r) {
      const TileRun& run = order.runs[r];
      bytes.resize(run.size() * record_size(wide));
      serialize(batch_, std::span(order.order).subspan(run.begin, run.size()), wide, bytes);
      status.set(file_.write(end_ + run.begin * record_size(wide), bytes));
    }
  });
  return status.get();
}

void SpilledPoints::list_chunks(const TileOrder& order, bool wide) {
  for (const TileRun& run : order.runs) {
    const std::uint32_t t = index_.add(run.key);
    if (t >= chunks_.size()) chunks_.resize(t + 1);
    chunks_[t].push_back({end_ + run.begin * record_size(wide), run.size(), wide});
  }
  end_ += order.order.size() * record_size(wide);
}

std::uint64_t SpilledPoints::record_size(bool wide) const {
  return bytes_per_point(layout_) - sizeof(Vec3) + 3 * (wide ? sizeof(double) : sizeof(float));
}

Result<std::vector<TileSet::Entry>> SpilledPoints::finish() {
  if (!batch_.empty()) MAPCODEC_TRY(flush());
  batch_ = PointCloud(layout_);  // moved in, not copied: that gives the memory back
  std::vector<std::uint32_t> by_key(chunks_.size());
  std::iota(by_key.begin(), by_key.end(), 0u);
  std::sort(by_key.begin(), by_key.end(), [&](std::uint32_t a, std::uint32_t b) {
    return compare_morton(index_.keys()[a], index_.keys()[b]) < 0;
  });
  std::vector<TileSet::Entry> tiles;
  std::vector<std::vector<Chunk>> sorted;
  for (const std::uint32_t t : by_key) {
    tiles.push_back({index_.keys()[t], 0});
    for (const Chunk& c : chunks_[t]) tiles.back().points += c.points;
    sorted.push_back(std::move(chunks_[t]));
  }
  chunks_ = std::move(sorted);
  index_ = {};
  return tiles;
}

Result<PointCloud> SpilledPoints::load(std::size_t i) const {
  std::uint64_t points = 0;
  for (const Chunk& c : chunks_[i]) points += c.points;
  PointCloud tile = layout_;
  tile.xyz.reserve(points);
  for (Channel& c : tile.channels) c.data.reserve(points * c.info.stride());
  Bytes buffer;
  for (const Chunk& c : chunks_[i]) MAPCODEC_TRY(read_chunk(c, tile, buffer));
  return tile;
}

Status SpilledPoints::read_chunk(const Chunk& chunk, PointCloud& tile, Bytes& buffer) const {
  buffer.resize(chunk.points * record_size(chunk.wide));
  MAPCODEC_TRY(file_.read(chunk.offset, buffer));
  const std::uint8_t* in = buffer.data();
  in = chunk.wide ? get_xyz<double>(in, chunk.points, tile.xyz) : get_xyz<float>(in, chunk.points, tile.xyz);
  for (Channel& c : tile.channels) {
    const std::size_t size = chunk.points * c.info.stride();
    c.data.insert(c.data.end(), in, in + size);
    in += size;
  }
  return {};
}

}  // namespace mapcodec
