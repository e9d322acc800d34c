// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "mapcodec/cloud/normals.hpp"
#include "mapcodec/cloud/point_stream.hpp"
#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

/// What one file format adds to a sink: what stands around the records.
class RecordWriter {
 public:
  virtual ~RecordWriter() = default;
  [[nodiscard]] virtual const RecordPlan& plan() const = 0;
  /// Sees the first block before it is turned into records.
  virtual void prepare(const PointCloud&) {}
  virtual Status begin(OutputFile& file, std::uint64_t points) = 0;
  /// Appends `count` records; may change them.
  virtual Status write(OutputFile& file, std::uint8_t* rows, std::size_t count) = 0;
  /// Before the file is closed.
  virtual Status end(OutputFile& file, std::uint64_t points) = 0;
};

/// A writer, and what it loses of the layout that it was made for.
struct WriterChoice {
  std::unique_ptr<RecordWriter> writer;
  std::vector<std::string> losses;
};

[[nodiscard]] WriterChoice make_pcd_writer(const PointCloud& layout, const WriteOptions& options);
[[nodiscard]] WriterChoice make_ply_writer(const PointCloud& layout, const WriteOptions& options);
[[nodiscard]] WriterChoice make_xyz_writer(const PointCloud& layout);
[[nodiscard]] WriterChoice make_pts_writer(const PointCloud& layout);
[[nodiscard]] WriterChoice make_vtk_writer(const PointCloud& layout);
/// Point format and version depend on the channels and, beyond 2^32, on the count.
[[nodiscard]] WriterChoice make_las_writer(const PointCloud& layout, std::uint64_t points);
[[nodiscard]] WriterChoice make_kitti_writer(const PointCloud& layout);

/// Records under construction: the fields that a header lists and the plan that fills them from a layout.
class WriteFields {
 public:
  /// x, y, z as f32, or as f64 (for fixed coordinates too, where the format has no scale).
  explicit WriteFields(const PointCloud& layout);
  /// One field for `info`, called `name`. False, and nothing added, if that name is taken or no header could
  /// hold it.
  bool add(const ChannelInfo& info, const std::string& name);
  /// One field per component.
  bool split(const ChannelInfo& info, const std::vector<std::string>& names);
  /// The four bytes of PCD's colour: rgb (u8x3) and, if the layout has it, alpha.
  bool add_packed_rgb(const PointCloud& layout, const char* name, ScalarType scalar);
  /// A field of zeros.
  void add_zeros(const std::string& name, ScalarType scalar);

  std::vector<RecordField> fields;
  RecordPlan plan;

 private:
  [[nodiscard]] bool available(const std::string& name) const;
  void append(const std::string& name, ScalarType scalar, std::size_t components);
};
/// "the channel NAME (TYPE) is not written".
[[nodiscard]] std::string loss(const ChannelInfo& info);
/// NAME_0, NAME_1, ...: for formats without vectors.
[[nodiscard]] std::vector<std::string> numbered_names(const ChannelInfo& info);
/// Whether a format without vectors writes `info` under numbered names (colours and normals have their own).
[[nodiscard]] bool is_taken_apart(const ChannelInfo& info);
/// "the channel NAME (TYPE) is written as NAME_0, NAME_1, ...".
[[nodiscard]] std::string taken_apart(const ChannelInfo& info);
/// Says of each channel that `plan` lacks that it is lost, and of each of another type that it is converted.
void note_losses(const PointCloud& layout, const RecordPlan& plan, std::vector<std::string>& losses);
/// Whether `info` is the channel `name` of `components` of one of `types`.
[[nodiscard]] bool is_channel(const ChannelInfo& info, const char* name, std::size_t components,
                              std::initializer_list<ScalarType> types);

}  // namespace mapcodec
