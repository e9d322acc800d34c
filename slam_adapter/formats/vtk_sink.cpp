// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/formats/byte_order.hpp"
#include "slam_adapter/formats/record_sink.hpp"

namespace mapcodec {
namespace {

const char* vtk_type(ScalarType t) {
  constexpr const char* kNames[] = {"",    "unsigned_char", "char", "unsigned_short", "short", "unsigned_int",
                                    "int", "unsigned_long", "long", "float",          "double"};
  return kNames[static_cast<std::size_t>(t)];
}

/// Column after column, so each block goes to several places, known from the number of points.
class VtkWriter final : public RecordWriter {
 public:
  explicit VtkWriter(WriteFields fields) : fields_(std::move(fields)) {}
  [[nodiscard]] const RecordPlan& plan() const override { return fields_.plan; }

  Status begin(OutputFile& file, std::uint64_t points) override {
    const std::string n = std::to_string(points);
    const auto& f = fields_.fields;
    MAPCODEC_TRY(text(file, "# vtk DataFile Version 3.0\npoint cloud\nBINARY\nDATASET POLYDATA\nPOINTS " + n +
                                " " + vtk_type(f[0].scalar) + "\n"));
    add_column(0, scalar_size(f[0].scalar) * 3, points);
    MAPCODEC_TRY(text(file, "\nVERTICES " + n + " " + std::to_string(2 * points) + "\n"));
    vertices_at_ = at_;
    at_ += points * 8;
    MAPCODEC_TRY(text(file, "\nPOINT_DATA " + n + "\nFIELD channels " + std::to_string(f.size() - 3) + "\n"));
    for (std::size_t i = 3; i < f.size(); ++i) {
      MAPCODEC_TRY(text(file, f[i].name + " " + std::to_string(f[i].components) + " " + n + " " +
                                  vtk_type(f[i].scalar) + "\n"));
      add_column(f[i].offset, scalar_size(f[i].scalar) * f[i].components, points);
      MAPCODEC_TRY(text(file, "\n"));
    }
    return {};
  }

  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    swap_fields(fields_.fields, fields_.plan.stride, rows, count);
    for (const Column& c : columns_) {
      scratch_.resize(count * c.size);
      for (std::size_t i = 0; i < count; ++i)
        std::memcpy(scratch_.data() + i * c.size, rows + i * fields_.plan.stride + c.from, c.size);
      MAPCODEC_TRY(file.write_at(c.at + written_ * c.size, scratch_));
    }
    MAPCODEC_TRY(write_vertices(file, count));
    written_ += count;
    return {};
  }
  Status end(OutputFile&, std::uint64_t) override { return {}; }

 private:
  struct Column {
    std::size_t from, size;
    std::uint64_t at;
  };
  void add_column(std::size_t from, std::size_t size, std::uint64_t points) {
    columns_.push_back({from, size, at_});
    at_ += size * points;
  }
  Status text(OutputFile& file, const std::string& s) {
    const std::uint64_t to = at_;
    at_ += s.size();
    return file.write_at(to, ByteSpan(reinterpret_cast<const std::uint8_t*>(s.data()), s.size()));
  }
  /// One cell of one point each, without which viewers draw nothing.
  Status write_vertices(OutputFile& file, std::size_t count) {
    scratch_.clear();
    const auto put = [&](std::uint64_t v) {
      for (int shift = 24; shift >= 0; shift -= 8) scratch_.push_back(static_cast<std::uint8_t>(v >> shift));
    };
    for (std::uint64_t i = 0; i < count; ++i) {
      put(1);
      put(written_ + i);
    }
    return file.write_at(vertices_at_ + written_ * 8, scratch_);
  }

  WriteFields fields_;
  std::vector<Column> columns_;
  Bytes scratch_;
  std::uint64_t at_ = 0, vertices_at_ = 0, written_ = 0;
};

}  // namespace

WriterChoice make_vtk_writer(const PointCloud& layout) {
  WriterChoice r;
  WriteFields fields(layout);
  for (const Channel& c : layout.channels) {
    if (!fields.add(c.info, c.info.name)) r.losses.push_back(loss(c.info));
  }
  r.writer = std::make_unique<VtkWriter>(std::move(fields));
  return r;
}

}  // namespace mapcodec
