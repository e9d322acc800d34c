// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/record_sink.hpp"
#include "slam_adapter/formats/text_rows.hpp"

namespace mapcodec {
namespace {

/// Null where PLY has no such type.
const char* ply_type(ScalarType t) {
  switch (t) {
    case ScalarType::u8:
      return "uchar";
    case ScalarType::i8:
      return "char";
    case ScalarType::u16:
      return "ushort";
    case ScalarType::i16:
      return "short";
    case ScalarType::u32:
      return "uint";
    case ScalarType::i32:
      return "int";
    case ScalarType::f32:
      return "float";
    case ScalarType::f64:
      return "double";
    default:
      return nullptr;
  }
}

class PlyWriter final : public RecordWriter {
 public:
  PlyWriter(WriteFields fields, bool ascii) : fields_(std::move(fields)), ascii_(ascii) {}
  [[nodiscard]] const RecordPlan& plan() const override { return fields_.plan; }
  Status begin(OutputFile& file, std::uint64_t points) override {
    std::string h = std::string("ply\nformat ") + (ascii_ ? "ascii" : "binary_little_endian") +
                    " 1.0\nelement vertex " + std::to_string(points) + "\n";
    for (const RecordField& f : fields_.fields)
      h += std::string("property ") + ply_type(f.scalar) + " " + f.name + "\n";
    return file.append(h + "end_header\n");
  }
  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    const ByteSpan bytes(rows, count * fields_.plan.stride);
    return ascii_ ? append_text_rows(file, fields_.fields, fields_.plan.stride, bytes) : file.append(bytes);
  }
  Status end(OutputFile&, std::uint64_t) override { return {}; }

 private:
  WriteFields fields_;
  bool ascii_;
};

bool add_ply_channel(WriteFields& to, const ChannelInfo& c) {
  if (ply_type(c.scalar) == nullptr) return false;
  if (is_channel(c, "rgb", 3, {ScalarType::u8, ScalarType::u16}))
    return to.split(c, {"red", "green", "blue"});
  if (is_normals(c)) return to.split(c, {"nx", "ny", "nz"});
  return c.components == 1 ? to.add(c, c.name) : to.split(c, numbered_names(c));
}

}  // namespace

WriterChoice make_ply_writer(const PointCloud& layout, const WriteOptions& options) {
  WriterChoice r;
  WriteFields fields(layout);
  for (const Channel& c : layout.channels) {
    if (!add_ply_channel(fields, c.info))
      r.losses.push_back(loss(c.info));
    else if (is_taken_apart(c.info))
      r.losses.push_back(taken_apart(c.info));
  }
  r.writer = std::make_unique<PlyWriter>(std::move(fields), options.ascii);
  return r;
}

}  // namespace mapcodec
