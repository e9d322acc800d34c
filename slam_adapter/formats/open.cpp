// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>

#include "slam_adapter/autoware/autoware_folder.hpp"
#include "slam_adapter/formats/detect.hpp"
#include "slam_adapter/formats/las.hpp"
#include "slam_adapter/formats/laz.hpp"
#include "slam_adapter/formats/pcd.hpp"
#include "slam_adapter/formats/ply.hpp"
#include "slam_adapter/formats/scan_folder.hpp"
#include "slam_adapter/formats/text_table.hpp"
#include "slam_adapter/formats/vtk.hpp"
#ifdef MAPCODEC_E57
#include "slam_adapter/e57/e57.hpp"
#endif
#ifdef MAPCODEC_ROSBAG
#include "slam_adapter/rosbag/bag_scans.hpp"
#endif
#include "slam_adapter/mrpt/log_source.hpp"

namespace mapcodec {
namespace {

bool is_folder(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

/// Read by a program of its own, from a file.
bool is_mrpt(Format format) {
  return format == Format::rawlog || format == Format::simplemap || format == Format::mrpt_object;
}

ReaderResult open_reader(const ByteStream& stream, Format format) {
  switch (format) {
    case Format::pcd:
      return open_pcd(stream);
    case Format::ply:
      return open_ply(stream);
    case Format::las:
      return open_las(stream);
#ifdef MAPCODEC_E57
    case Format::e57:
      return open_e57(stream);
#endif
    case Format::laz:
      return open_laz(stream);
    case Format::vtk:
      return open_vtk(stream);
    case Format::pts:
      return open_text(stream, TextShape::pts);
    case Format::ptx:
      return open_text(stream, TextShape::ptx);
    case Format::xyz:
      return open_text(stream, TextShape::plain);
    case Format::kitti:
      return open_kitti(stream);
    default:
      break;
  }
  const FormatInfo& info = format_info(format);
  if (is_mrpt(format))
    return make_error(ErrorCode::kUnsupported,
                      std::string("is an ") + info.name + ": give its path, not its bytes");
  const std::string what = format == Format::unknown
                               ? "is not recognised: "
                               : std::string("is ") + info.name + ", which is not read here: ";
  return make_error(ErrorCode::kUnsupported, what + info.advice);
}

Status check_not_empty(const ByteStream& stream) {
  if (stream.size() > 0) return {};
  return make_error(ErrorCode::kEmpty, "is empty (0 bytes)");
}

Result<std::unique_ptr<PointSource>> open_stream(std::unique_ptr<ByteStream> stream, std::string name,
                                                 const ReadOptions& options) {
  if (const Status s = check_not_empty(*stream); !s.ok()) return named(name, s.error());
  const Format format = recognise(*stream, name);
#ifdef MAPCODEC_ROSBAG
  if (format == Format::rosbag) return open_bag(std::move(stream), name, options);
#endif
  auto reader = open_reader(*stream, format);
  if (!reader.ok()) return named(name, reader.error());
  return make_source(std::move(stream), std::move(reader).value(), std::move(name), options);
}

/// What a 3DTK scan is called, which the name alone tells from other columns of numbers.
std::string format_name(Format format, const std::string& path) {
  return format == Format::xyz && extension_of(path) == ".3d" ? "3DTK" : format_info(format).name;
}

}  // namespace

Result<std::unique_ptr<PointSource>> open_source(const std::string& path, const ReadOptions& options) {
  if (is_folder(path) && is_scan_folder(path)) return open_scan_folder(path, options);
  if (is_autoware_folder(path)) return open_autoware_folder(path, options);
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  if (is_mrpt(recognise(**stream, path))) return open_log(path, options);
  return open_stream(std::move(stream).value(), path, options);
}

Result<std::unique_ptr<PointSource>> open_source_memory(ByteSpan bytes, std::string name,
                                                        const ReadOptions& options) {
  return open_stream(memory_stream(bytes), std::move(name), options);
}

Result<std::string> detect_format(const std::string& path) {
  if (is_folder(path) && is_scan_folder(path)) return std::string("3DTK");
  if (is_autoware_folder(path)) return std::string("Autoware");
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  if (const Status s = check_not_empty(**stream); !s.ok()) return named(path, s.error());
  const Format format = recognise(**stream, path);
  if (format != Format::unknown) return format_name(format, path);
  return named(path, make_error(ErrorCode::kUnsupported,
                                std::string("is not recognised: ") + format_info(format).advice));
}

Result<std::uint64_t> input_bytes(const std::string& path) {
  if (is_folder(path) && is_scan_folder(path)) return scan_folder_bytes(path);
  if (is_autoware_folder(path)) return autoware_folder_bytes(path);
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  return (*stream)->size();
}

}  // namespace mapcodec
