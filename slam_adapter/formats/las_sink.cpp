// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/formats/las_layout.hpp"
#include "slam_adapter/formats/record_sink.hpp"

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

bool has(const PointCloud& layout, const ChannelInfo& info) {
  const Channel* c = layout.find(info.name);
  return c != nullptr && c->info == info;
}

/// The smallest point format that holds what of the layout any holds.
unsigned choose_format(const PointCloud& layout, std::uint64_t points) {
  const bool rgb = has(layout, {"rgb", ScalarType::u16, 3}) || has(layout, {"rgb", ScalarType::u8, 3});
  const bool gps = has(layout, {"gps_time", ScalarType::f64, 1});
  const bool nir = has(layout, {"nir", ScalarType::u16, 1});
  const bool wave = has(layout, {"wave_packet", ScalarType::u8, 29});
  const bool wide = has(layout, {"scan_angle", ScalarType::i16, 1}) ||
                    has(layout, {"scanner_channel", ScalarType::u8, 1}) || nir;
  if (wide || points > std::numeric_limits<std::uint32_t>::max()) {
    if (wave) return rgb || nir ? 10 : 9;
    return nir ? 8 : rgb ? 7 : 6;
  }
  if (wave) return rgb ? 5 : 4;
  return rgb ? (gps ? 3 : 2) : (gps ? 1 : 0);
}

std::size_t extra_bytes(const PointCloud& layout) {
  std::size_t n = 0;
  for (const Channel& c : layout.channels) {
    const bool extra = c.info.name == "extra_bytes" || c.info.name.starts_with("extra_bytes_");
    if (extra && c.info.scalar == ScalarType::u8) n += c.info.components;
  }
  return n;
}

class LasWriter final : public RecordWriter {
 public:
  LasWriter(unsigned format, RecordPlan plan, bool choose_offset)
      : format_(format), plan_(std::move(plan)), choose_offset_(choose_offset) {}
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  /// Whole kilometres near the first points, so that 32 bits reach 200 km around them.
  void prepare(const PointCloud& first) override {
    const Box box = choose_offset_ ? first.bounds() : Box();
    for (std::size_t d = 0; d < 3 && !box.empty(); ++d)
      plan_.layout.coordinates.offset[d] = std::floor(box.min[d] / 1000) * 1000;
  }
  Status begin(OutputFile& file, std::uint64_t) override { return file.append(Bytes(header_size())); }

  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    for (std::size_t i = 0; i < count; ++i) note(rows + i * plan_.stride);
    return file.append(ByteSpan(rows, count * plan_.stride));
  }

  Status end(OutputFile& file, std::uint64_t points) override {
    ByteWriter h;
    write_front(h, points);
    write_bounds(h);
    if (minor() >= 3) h.u64(0);  // no waveform record
    if (minor() >= 4) write_long_counts(h, points);
    return file.write_at(0, h.bytes());
  }

 private:
  [[nodiscard]] unsigned minor() const { return las_is_wide(format_) ? 4 : format_ >= 4 ? 3 : 2; }
  [[nodiscard]] std::size_t header_size() const { return las_header_size(minor()); }

  void note(const std::uint8_t* row) {
    for (std::size_t d = 0; d < 3; ++d) {
      std::int32_t v = 0;
      std::memcpy(&v, row + 4 * d, 4);
      min_[d] = std::min(min_[d], v);
      max_[d] = std::max(max_[d], v);
    }
    const unsigned number = row[14] & (las_is_wide(format_) ? 15 : 7);
    if (number >= 1 && number <= 15) ++returns_[number - 1];
  }

  void write_front(ByteWriter& h, std::uint64_t points) const {
    const auto text = [&](std::string_view s, std::size_t size) {
      for (std::size_t i = 0; i < size; ++i) h.u8(i < s.size() ? static_cast<std::uint8_t>(s[i]) : 0);
    };
    text("LASF", 4);
    h.u16(0);
    // Point formats 6 and up must say that a coordinate system, had it been given, would be in WKT.
    h.u16(las_is_wide(format_) ? 16 : 0);
    text("", 16);
    h.u8(1);
    h.u8(static_cast<std::uint8_t>(minor()));
    text("mapcodec", 32);
    text("mapcodec", 32);
    h.u32(0);  // no date: the same points make the same bytes on any day
    h.u16(static_cast<std::uint16_t>(header_size()));
    h.u32(static_cast<std::uint32_t>(header_size()));
    h.u32(0);
    h.u8(static_cast<std::uint8_t>(format_));
    h.u16(static_cast<std::uint16_t>(plan_.stride));
    const bool legacy = !las_is_wide(format_);
    h.u32(legacy ? static_cast<std::uint32_t>(points) : 0);
    for (std::size_t i = 0; i < 5; ++i) h.u32(legacy ? static_cast<std::uint32_t>(returns_[i]) : 0);
  }
  void write_bounds(ByteWriter& h) const {
    const CoordinateFormat& c = plan_.layout.coordinates;
    for (const double v : c.scale) h.f64(v);
    for (const double v : c.offset) h.f64(v);
    for (std::size_t d = 0; d < 3; ++d) {
      const bool any = min_[d] <= max_[d];
      h.f64(any ? max_[d] * c.scale[d] + c.offset[d] : 0);
      h.f64(any ? min_[d] * c.scale[d] + c.offset[d] : 0);
    }
  }
  void write_long_counts(ByteWriter& h, std::uint64_t points) const {
    h.u64(0);
    h.u32(0);
    h.u64(points);
    for (const std::uint64_t n : returns_) h.u64(n);
  }

  unsigned format_;
  RecordPlan plan_;
  bool choose_offset_;
  std::array<std::int32_t, 3> min_{INT32_MAX, INT32_MAX, INT32_MAX}, max_{INT32_MIN, INT32_MIN, INT32_MIN};
  std::array<std::uint64_t, 15> returns_{};
};

class KittiWriter final : public RecordWriter {
 public:
  explicit KittiWriter(RecordPlan plan) : plan_(std::move(plan)) {}
  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  Status begin(OutputFile&, std::uint64_t) override { return {}; }
  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    return file.append(ByteSpan(rows, count * plan_.stride));
  }
  Status end(OutputFile&, std::uint64_t) override { return {}; }

 private:
  RecordPlan plan_;
};

}  // namespace

WriterChoice make_las_writer(const PointCloud& layout, std::uint64_t points) {
  WriterChoice r;
  const bool fixed = layout.coordinates.kind == Kind::fixed;
  const CoordinateFormat coordinates =
      fixed ? layout.coordinates : CoordinateFormat{Kind::fixed, {1e-4, 1e-4, 1e-4}, {0, 0, 0}};
  if (!fixed) r.losses.emplace_back("coordinates are rounded to LAS integers of 0.1 mm");
  const unsigned format = choose_format(layout, points);
  RecordPlan plan = las_plan(format, las_record_size(format) + extra_bytes(layout), coordinates);
  note_losses(layout, plan, r.losses);
  r.writer = std::make_unique<LasWriter>(format, std::move(plan), !fixed);
  return r;
}

WriterChoice make_kitti_writer(const PointCloud& layout) {
  WriterChoice r;
  PointCloud narrow = layout.like();
  narrow.coordinates = {};
  if (layout.coordinates.kind != Kind::f32) r.losses.emplace_back("coordinates are rounded to float32");
  WriteFields fields(narrow);
  fields.add({"intensity", ScalarType::f32, 1}, "intensity");
  note_losses(layout, fields.plan, r.losses);
  r.writer = std::make_unique<KittiWriter>(std::move(fields.plan));
  return r;
}

}  // namespace mapcodec
