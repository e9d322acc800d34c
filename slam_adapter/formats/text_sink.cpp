// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/record_sink.hpp"
#include "slam_adapter/formats/text_number.hpp"
#include "slam_adapter/formats/text_rows.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {
namespace {

/// "# x:f32 y:f32 z:f32 ring:u16": other programs pass the comment, ours learns the types.
std::string xyz_header(const std::vector<RecordField>& fields) {
  std::string r = "#";
  for (const RecordField& f : fields) r += " " + f.name + ":" + scalar_name(f.scalar);
  return r + "\n";
}

class TextWriter final : public RecordWriter {
 public:
  TextWriter(WriteFields fields, bool counted) : fields_(std::move(fields)), counted_(counted) {}
  [[nodiscard]] const RecordPlan& plan() const override { return fields_.plan; }
  Status begin(OutputFile& file, std::uint64_t points) override {
    return file.append(counted_ ? std::to_string(points) + "\n" : xyz_header(fields_.fields));
  }
  Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) override {
    return append_text_rows(file, fields_.fields, fields_.plan.stride,
                            ByteSpan(rows, count * fields_.plan.stride));
  }
  Status end(OutputFile&, std::uint64_t) override { return {}; }

 private:
  WriteFields fields_;
  bool counted_;
};

/// Without what separates columns or begins comments, and nothing that the reader would take for another
/// name.
bool plain_name(const std::string& name) {
  return name.find_first_of(",;#/\"':") == std::string::npos && column_key(name) == name;
}

bool add_xyz_channel(WriteFields& to, const ChannelInfo& c) {
  if (is_channel(c, "rgb", 3, {ScalarType::u8, ScalarType::u16}))
    return to.split(c, {"red", "green", "blue"});
  if (is_normals(c)) return to.split(c, {"nx", "ny", "nz"});
  if (!plain_name(c.name)) return false;
  return c.components == 1 ? to.add(c, c.name) : to.split(c, numbered_names(c));
}

}  // namespace

Status append_text_rows(OutputFile& file, const std::vector<RecordField>& fields, std::size_t stride,
                        ByteSpan rows) {
  std::string text;
  for (std::size_t at = 0; at < rows.size(); at += stride) {
    for (const RecordField& f : fields) {
      const std::size_t size = scalar_size(f.scalar);
      for (std::size_t k = 0; k < f.components; ++k) {
        append_number(text, f.scalar, rows.data() + at + f.offset + k * size);
        text.push_back(' ');
      }
    }
    text.back() = '\n';
    if (text.size() < (std::size_t{1} << 16)) continue;
    MAPCODEC_TRY(file.append(text));
    text.clear();
  }
  return file.append(text);
}

WriterChoice make_xyz_writer(const PointCloud& layout) {
  WriterChoice r;
  WriteFields fields(layout);
  for (const Channel& c : layout.channels) {
    if (!add_xyz_channel(fields, c.info))
      r.losses.push_back(loss(c.info));
    else if (is_taken_apart(c.info))
      r.losses.push_back(taken_apart(c.info));
  }
  r.writer = std::make_unique<TextWriter>(std::move(fields), false);
  return r;
}

/// x y z [intensity [r g b]]: where there is colour, an intensity must stand before it.
WriterChoice make_pts_writer(const PointCloud& layout) {
  WriterChoice r;
  PointCloud wide = layout.like();
  wide.coordinates.kind =
      CoordinateFormat::Kind::f64;  // the file names no type, so its text is that of the double
  WriteFields fields(wide);
  const Channel *intensity = layout.find("intensity"), *rgb = layout.find("rgb");
  const bool has_intensity = intensity != nullptr && intensity->info.components == 1;
  const bool has_rgb = rgb != nullptr && is_channel(rgb->info, "rgb", 3, {ScalarType::u8, ScalarType::u16});
  if (has_intensity) fields.add(intensity->info, "intensity");
  if (has_rgb && !has_intensity) fields.add_zeros("intensity", ScalarType::u8);
  if (has_rgb) fields.split(rgb->info, {"red", "green", "blue"});
  for (const Channel& c : layout.channels) {
    if (!(has_intensity && &c == intensity) && !(has_rgb && &c == rgb)) r.losses.push_back(loss(c.info));
  }
  r.writer = std::make_unique<TextWriter>(std::move(fields), true);
  return r;
}

}  // namespace mapcodec
