// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/record_source.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

std::string text(const char* format, double v) {
  char buffer[64];
  std::snprintf(buffer, sizeof(buffer), format, v);
  return buffer;
}

bool same_layout(const PointCloud& a, const PointCloud& b) {
  return a.coordinates == b.coordinates &&
         std::equal(a.channels.begin(), a.channels.end(), b.channels.begin(), b.channels.end(),
                    [](const Channel& x, const Channel& y) { return x.info == y.info; });
}

class RecordSource final : public NamedSource {
 public:
  RecordSource(std::unique_ptr<ByteStream> stream, std::unique_ptr<RecordReader> reader, std::string name,
               const ReadOptions& options)
      : NamedSource(std::move(name)),
        stream_(std::move(stream)),
        reader_(std::move(reader)),
        options_(options),
        layout_(reader_->plan().layout.like()) {
    if (options_.unit_m != 1) layout_.coordinates = {Kind::f64, {1, 1, 1}, {0, 0, 0}};
  }

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override {
    return reader_->announced_points();
  }
  [[nodiscard]] std::uint64_t dropped_points() const override { return dropped_ + reader_->skipped(); }

  Result<bool> next(PointCloud& block) override {
    if (!same_layout(block, layout_)) block = layout_;
    block.resize(0);
    while (status_.ok()) {
      auto read = read_block(block);
      if (!read.ok())
        status_ = named(name(), read.error());
      else if (!*read || !block.empty())
        return *read;
    }
    block.resize(0);
    return status_.error();
  }

  Status rewind() override {
    status_ = {};
    dropped_ = 0;
    reader_->rewind();
    return {};
  }

  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> r = reader_->warnings();
    if (reader_->plan().layout.coordinates.kind == Kind::f32 && largest_ > 1e4) r.push_back(float_warning());
    for (std::string& w : r) w.insert(0, name() + ": ");
    return r;
  }

 private:
  Result<bool> read_block(PointCloud& block) {
    const RecordPlan& plan = reader_->plan();
    const std::size_t max = plan.rows_per_block();
    rows_.resize(max * plan.stride);
    MAPCODEC_ASSIGN(const std::size_t count, reader_->read(rows_.data(), max));
    if (count == 0) return false;
    plan.decode(rows_.data(), count, block);
    check_points(block);
    if (options_.unit_m != 1) scale(block);
    return true;
  }

  void check_points(PointCloud& block) {
    constexpr double kMax = std::numeric_limits<double>::max();
    bool all_finite = true;
    double largest = largest_;
    for (const Vec3& p : block.xyz) {
      const double m = std::max({std::fabs(p[0]), std::fabs(p[1]), std::fabs(p[2])});
      // fabs(x) <= max is false for NaN and infinity; std::max alone would lose a NaN.
      const bool finite = std::fabs(p[0]) <= kMax && std::fabs(p[1]) <= kMax && std::fabs(p[2]) <= kMax;
      all_finite = all_finite && finite;
      if (finite && m > largest) largest = m;
    }
    largest_ = largest;
    if (!all_finite && !options_.keep_nonfinite) dropped_ += drop_nonfinite(block);
  }

  void scale(PointCloud& block) const {
    for (Vec3& p : block.xyz) {
      for (double& v : p) v *= options_.unit_m;
    }
  }

  [[nodiscard]] std::string float_warning() const {
    const auto top = static_cast<float>(largest_);
    const double ulp = double(top) - double(std::nextafter(top, 0.0f));
    return "coordinates reach " + text("%.0f", largest_) +
           " but are stored as float32, whose neighbours lie " + text("%.3g", ulp) +
           " apart there: they cannot hold millimetres";
  }

  std::unique_ptr<ByteStream> stream_;
  std::unique_ptr<RecordReader> reader_;
  ReadOptions options_;
  PointCloud layout_;
  Bytes rows_;
  Status status_;
  std::uint64_t dropped_ = 0;
  double largest_ = 0;
};

Error size_error(ErrorCode code, const Cursor& cursor, std::uint64_t count, std::size_t stride) {
  const std::uint64_t left = cursor.left();
  return make_error(code,
                    "announces " + std::to_string(count) + " points of " + std::to_string(stride) +
                        " bytes, but holds " + std::to_string(left / stride) + " (" + std::to_string(left) +
                        " bytes after the header)",
                    cursor.offset());
}

}  // namespace

std::size_t drop_nonfinite(PointCloud& block) {
  const std::size_t before = block.size();
  std::size_t n = 0;  // moved to the front run by run
  for (std::size_t begin = 0; begin < block.size();) {
    std::size_t end = begin;
    while (end < block.size() && is_finite(block.xyz[end])) ++end;
    const std::size_t run = end - begin;
    if (run > 0 && n != begin) {
      std::memmove(&block.xyz[n], &block.xyz[begin], run * sizeof(Vec3));
      for (Channel& c : block.channels) std::memmove(c.at(n), c.at(begin), run * c.info.stride());
    }
    n += run;
    begin = end + 1;
  }
  block.resize(n);
  return before - n;
}

std::unique_ptr<PointSource> make_source(std::unique_ptr<ByteStream> stream,
                                         std::unique_ptr<RecordReader> reader, std::string name,
                                         const ReadOptions& options) {
  return std::make_unique<RecordSource>(std::move(stream), std::move(reader), std::move(name), options);
}

Error named(const std::string& name, Error error) {
  error.message.insert(0, name + ": ");
  return error;
}

Result<std::size_t> read_records(Cursor& cursor, std::uint64_t count, std::size_t stride, std::uint8_t* rows,
                                 std::size_t max) {
  const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(count, max));
  const ByteSpan bytes = cursor.take(n * stride);
  if (!cursor.status().ok()) return cursor.status().error();
  if (bytes.size() < n * stride)
    return make_error(ErrorCode::kTruncated, "became shorter while it was read", cursor.offset());
  std::memcpy(rows, bytes.data(), bytes.size());
  return n;
}

Status check_enough(const Cursor& cursor, std::uint64_t count, std::size_t stride) {
  if (count > cursor.left() / stride) return size_error(ErrorCode::kTruncated, cursor, count, stride);
  return {};
}

Status check_exact_size(const Cursor& cursor, std::uint64_t count, std::size_t stride) {
  MAPCODEC_TRY(check_enough(cursor, count, stride));
  if (cursor.left() > count * stride) return size_error(ErrorCode::kMalformed, cursor, count, stride);
  return {};
}

}  // namespace mapcodec
