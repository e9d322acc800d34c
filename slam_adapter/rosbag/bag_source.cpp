// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/cloud/normals.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/rosbag/bag_scans.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kBlockPoints = 65536;

class BagSource final : public NamedSource {
 public:
  BagSource(std::unique_ptr<BagScans> scans, const std::string& name, const ReadOptions& options)
      : NamedSource(name), scans_(std::move(scans)), options_(options), layout_(scans_->layout().like()) {
    if (scans_->has_poses() || options_.unit_m != 1)
      layout_.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
  }

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return std::nullopt; }
  [[nodiscard]] std::uint64_t dropped_points() const override { return dropped_; }

  Result<bool> next(PointCloud& block) override {
    block = layout_.like();
    if (!status_.ok()) return status_.error();
    while (at_ == scan_.points.size()) {
      auto more = load();
      if (!more.ok()) status_ = named(name(), more.error());
      if (!status_.ok()) return status_.error();
      if (!*more) return false;
    }
    const std::size_t end = std::min(scan_.points.size(), at_ + kBlockPoints);
    block.append(scan_.points, at_, end);
    at_ = end;
    return true;
  }

  Status rewind() override {
    status_ = {};
    scans_->rewind();
    scan_.points.resize(0);
    at_ = 0;
    dropped_ = 0;
    return {};
  }

  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> r = scans_->warnings();
    for (std::string& w : r) w.insert(0, name() + ": ");
    return r;
  }

 private:
  /// The next scan, in the map's frame.
  Result<bool> load() {
    at_ = 0;
    MAPCODEC_ASSIGN(const bool more, scans_->next(scan_));
    if (!more) {
      scan_.points = layout_.like();
      return false;
    }
    if (!options_.keep_nonfinite) dropped_ += drop_nonfinite(scan_.points);
    PointCloud& points = scan_.points;
    points.coordinates = layout_.coordinates;
    for (Vec3& p : points.xyz) {
      for (double& v : p) v *= options_.unit_m;
      if (scan_.T_map_sensor) p = scan_.T_map_sensor->apply(p);
    }
    if (scan_.T_map_sensor)
      turn_normals(points, [&](const Vec3& n) { return scan_.T_map_sensor->rotate(n); });
    return true;
  }

  std::unique_ptr<BagScans> scans_;
  ReadOptions options_;
  PointCloud layout_;
  BagScan scan_;
  std::size_t at_ = 0;
  std::uint64_t dropped_ = 0;
  Status status_;
};

}  // namespace

Result<std::unique_ptr<PointSource>> open_bag(std::unique_ptr<ByteStream> stream, const std::string& name,
                                              const ReadOptions& options) {
  auto scans = BagScans::open(std::move(stream), options.bag);
  if (!scans.ok()) return named(name, scans.error());
  return std::unique_ptr<PointSource>(std::make_unique<BagSource>(std::move(scans).value(), name, options));
}

}  // namespace mapcodec
