// SPDX-License-Identifier: GPL-3.0-or-later
#include <limits>

#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/formats/lzf.hpp"
#include "slam_adapter/formats/record_sink.hpp"
#include "slam_adapter/formats/text_rows.hpp"

namespace mapcodec {
namespace {

char pcd_type(ScalarType t) {
  if (t == ScalarType::f32 || t == ScalarType::f64) return 'F';
  return std::string_view(scalar_name(t)).front() == 'u' ? 'U' : 'I';
}

std::string pcd_header(const std::vector<RecordField>& fields, std::uint64_t points, const char* data) {
  std::string names = "FIELDS", sizes = "SIZE", types = "TYPE", counts = "COUNT";
  for (const RecordField& f : fields) {
    names += " " + f.name;
    sizes += " " + std::to_string(scalar_size(f.scalar));
    types += std::string(" ") + pcd_type(f.scalar);
    counts += " " + std::to_string(f.components);
  }
  const std::string n = std::to_string(points);
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n" + names + "\n" + sizes + "\n" + types +
         "\n" + counts + "\nWIDTH " + n + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n + "\nDATA " +
         data + "\n";
}

class PcdWriter final : public RecordWriter {
 public:
  PcdWriter(WriteFields fields, const WriteOptions& options)
      : fields_(std::move(fields)), options_(options) {}
  [[nodiscard]] const RecordPlan& plan() const override { return fields_.plan; }

  Status begin(OutputFile& file, std::uint64_t points) override {
    if (options_.compressed && points > std::numeric_limits<std::uint32_t>::max() / fields_.plan.stride) {
      return make_error(ErrorCode::kInvalidArgument,
                        file.path() + ": binary_compressed PCD holds at most 4 GiB; write binary instead");
    }
    return file.append(pcd_header(fields_.fields, points,
                                  options_.ascii        ? "ascii"
                                  : options_.compressed ? "binary_compressed"
                                                        : "binary"));
  }
  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    const ByteSpan bytes(rows, count * fields_.plan.stride);
    if (options_.compressed) kept_.insert(kept_.end(), bytes.begin(), bytes.end());
    if (options_.compressed) return {};
    return options_.ascii ? append_text_rows(file, fields_.fields, fields_.plan.stride, bytes)
                          : file.append(bytes);
  }
  Status end(OutputFile& file, std::uint64_t points) override {
    if (!options_.compressed) return {};
    const Bytes packed = lzf_encode(columns(points));
    if (packed.size() > std::numeric_limits<std::uint32_t>::max()) {
      return make_error(ErrorCode::kInvalidArgument,
                        file.path() + ": does not fit binary_compressed PCD; write binary instead");
    }
    ByteWriter sizes;
    sizes.u32(static_cast<std::uint32_t>(packed.size()));
    sizes.u32(static_cast<std::uint32_t>(kept_.size()));
    MAPCODEC_TRY(file.append(sizes.bytes()));
    return file.append(packed);
  }

 private:
  /// Field after field.
  [[nodiscard]] Bytes columns(std::uint64_t points) const {
    Bytes out;
    out.reserve(kept_.size());
    for (const RecordField& f : fields_.fields) {
      const auto size = static_cast<std::ptrdiff_t>(scalar_size(f.scalar) * f.components);
      for (std::uint64_t i = 0; i < points; ++i) {
        const auto at = kept_.begin() + static_cast<std::ptrdiff_t>(i * fields_.plan.stride + f.offset);
        out.insert(out.end(), at, at + size);
      }
    }
    return out;
  }

  WriteFields fields_;
  WriteOptions options_;
  Bytes kept_;
};

bool add_pcd_channel(WriteFields& to, const PointCloud& layout, const ChannelInfo& c, bool ascii) {
  const Channel* rgb = layout.find("rgb");
  const bool packs = rgb != nullptr && is_channel(rgb->info, "rgb", 3, {ScalarType::u8});
  const bool alpha = layout.find("alpha") != nullptr;
  if (packs && is_channel(c, "alpha", 1, {ScalarType::u8})) return true;  // within the packed colour
  if (packs && c == rgb->info) {
    // As text a float cannot carry every alpha: its bits may be a NaN.
    return ascii && alpha ? to.add_packed_rgb(layout, "rgba", ScalarType::u32)
                          : to.add_packed_rgb(layout, "rgb", ScalarType::f32);
  }
  if (is_normals(c)) return to.split(c, {"normal_x", "normal_y", "normal_z"});
  return to.add(c, c.name);
}

}  // namespace

WriterChoice make_pcd_writer(const PointCloud& layout, const WriteOptions& options) {
  WriterChoice r;
  WriteFields fields(layout);
  for (const Channel& c : layout.channels) {
    if (!add_pcd_channel(fields, layout, c.info, options.ascii)) r.losses.push_back(loss(c.info));
  }
  r.writer = std::make_unique<PcdWriter>(std::move(fields), options);
  return r;
}

}  // namespace mapcodec
