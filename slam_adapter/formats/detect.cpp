// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/detect.hpp"

#include <algorithm>
#include <iterator>

#include "slam_adapter/formats/las.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {
namespace {

using namespace std::string_view_literals;

constexpr FormatInfo kInfos[] = {
    {Format::unknown, "unknown",
     "no known point format begins like this; known are PCD, PLY, LAS, LAZ, E57, ROS bags, VTK, PTS, PTX, "
     "XYZ and KITTI .bin"},
    {Format::pcd, "PCD", nullptr},
    {Format::ply, "PLY", nullptr},
    {Format::las, "LAS", nullptr},
    {Format::vtk, "VTK", nullptr},
    {Format::pts, "PTS", nullptr},
    {Format::ptx, "PTX", nullptr},
    {Format::xyz, "XYZ", nullptr},
    {Format::kitti, "KITTI", nullptr},
    {Format::laz, "LAZ", nullptr},
    {Format::e57, "E57",
     "this build lacks it (MAPCODEC_E57); or convert it first, for example with 'pdal translate IN.e57 "
     "OUT.las'"},
    {Format::gzip, "gzip", "unpack it first with 'gzip -dk FILE'"},
    {Format::zip, "zip", "unpack it first with 'unzip FILE'"},
    {Format::bzip2, "bzip2", "unpack it first with 'bzip2 -dk FILE'"},
    {Format::xz, "xz", "unpack it first with 'xz -dk FILE'"},
    {Format::zstd, "zstd", "unpack it first with 'zstd -d FILE'"},
    {Format::zlib7, "7z", "unpack it first with '7z x FILE'"},
    {Format::rosbag, "ROS bag",
     "this build lacks it (MAPCODEC_ROSBAG); or export its clouds first with 'rosrun pcl_ros bag_to_pcd FILE "
     "TOPIC FOLDER'"},
    {Format::ros2_db, "ROS 2 bag (sqlite3)",
     "make a ROS 1 bag of its folder first with 'rosbags-convert --src FOLDER --dst OUT.bag' (pip install "
     "rosbags)"},
    {Format::mcap, "MCAP (ROS 2 bag)",
     "make a ROS 1 bag of its folder first with 'rosbags-convert --src FOLDER --dst OUT.bag' (pip install "
     "rosbags)"},
    {Format::rawlog, "MRPT rawlog", nullptr},
    {Format::simplemap, "MRPT simplemap", nullptr},
    {Format::mrpt_object, "MRPT object", nullptr},
    {Format::octomap_bt, "OctoMap .bt",
     "octrees want a call of their own; as points, convert it first with OctoMap's 'octree2pointcloud IN.bt "
     "OUT.pcd'"},
    {Format::octomap_ot, "OctoMap .ot",
     "octrees want a call of their own; as points, convert it first with OctoMap's 'octree2pointcloud' after "
     "'convert_octree IN.ot OUT.bt'"},
    {Format::pcap, "pcap", "export its scans to PCD first with the sensor maker's tool"},
    {Format::hdf5, "HDF5", "export its points to PLY or PCD first"},
    {Format::image, "an image", "points are wanted: convert depth images to clouds first"},
};

struct Magic {
  std::string_view bytes;
  Format format;
};
constexpr Magic kMagics[] = {
    {"LASF"sv, Format::las},
    {"# vtk DataFile"sv, Format::vtk},
    {"ASTM-E57"sv, Format::e57},
    {"\x1f\x8b"sv, Format::gzip},
    {"PK\x03\x04"sv, Format::zip},
    {"BZh"sv, Format::bzip2},
    {"\xfd"
     "7zXZ"sv,
     Format::xz},
    {"\x28\xb5\x2f\xfd"sv, Format::zstd},
    {"7z\xbc\xaf"sv, Format::zlib7},
    {"#ROSBAG V"sv, Format::rosbag},
    {"SQLite format 3"sv, Format::ros2_db},
    {"\x89MCAP"sv, Format::mcap},
    {"# Octomap OcTree binary file"sv, Format::octomap_bt},
    {"# Octomap OcTree file"sv, Format::octomap_ot},
    {"\xd4\xc3\xb2\xa1"sv, Format::pcap},
    {"\xa1\xb2\xc3\xd4"sv, Format::pcap},
    {"\x0a\x0d\x0d\x0a"sv, Format::pcap},
    {"\x89HDF"sv, Format::hdf5},
    {"\x89PNG"sv, Format::image},
    {"\xff\xd8\xff"sv, Format::image},
};

/// MRPT's objects begin with the name of their class, its length before it.
Format by_class(std::string_view head) {
  const std::size_t length = head.empty() ? 0 : static_cast<unsigned char>(head[0]) & 0x7f;
  if (length < 4 || (static_cast<unsigned char>(head[0]) & 0x80) == 0) return Format::unknown;
  const std::string_view name = head.substr(1, length);
  if (name.find("CSimpleMap") != name.npos || name.find("CSensFrameProbSequence") != name.npos)
    return Format::simplemap;
  for (const std::string_view part : {"CObservation"sv, "CSensor"sv, "CAction"sv, "CRawlog"sv}) {
    if (name.find(part) != name.npos) return Format::rawlog;
  }
  return name.starts_with("mrpt::") || name.ends_with("Map") || name.find("PointsMap") != name.npos
             ? Format::mrpt_object
             : Format::unknown;
}

/// PCD files begin with comments or with one of these words.
bool is_pcd(const ByteStream& stream) {
  Cursor cursor(stream);
  std::string_view line;
  if (!cursor.content_line(line, true)) return false;
  for (const std::string_view key : {"VERSION"sv, "FIELDS"sv, "COLUMNS"sv}) {
    if (line.starts_with(key) && line.size() > key.size() &&
        (line[key.size()] == ' ' || line[key.size()] == '\t'))
      return true;
  }
  return false;
}

bool is_ply(std::string_view head) {
  return head == "ply" || head.starts_with("ply\n") || head.starts_with("ply\r");
}

/// MRPT files are gzip outside; what is inside only the name tells.
Format by_name(const std::string& extension, Format otherwise) {
  static const struct {
    std::string_view extension;
    Format format;
  } kNames[] = {{".rawlog", Format::rawlog},    {".simplemap", Format::simplemap},
                {".mrpt", Format::mrpt_object}, {".bag", Format::rosbag},
                {".e57", Format::e57},          {".laz", Format::laz},
                {".bt", Format::octomap_bt},    {".ot", Format::octomap_ot}};
  for (const auto& n : kNames) {
    if (extension == n.extension) return n.format;
  }
  return otherwise;
}

Format by_text_name(const std::string& extension) {
  if (extension == ".xyz" || extension == ".txt" || extension == ".3d" || extension == ".csv" ||
      extension == ".asc")
    return Format::xyz;
  if (extension == ".pts") return Format::pts;
  if (extension == ".ptx") return Format::ptx;
  if (extension == ".pcd") return Format::pcd;
  if (extension == ".ply") return Format::ply;
  if (extension == ".las") return Format::las;
  if (extension == ".vtk") return Format::vtk;
  if (extension == ".bin") return Format::kitti;
  return Format::unknown;
}

}  // namespace

std::string extension_of(const std::string& path) {
  const std::size_t slash = path.find_last_of('/');
  const std::size_t point = path.find_last_of('.');
  if (point == std::string::npos || (slash != std::string::npos && point < slash)) return "";
  std::string r = path.substr(point);
  std::transform(r.begin(), r.end(), r.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return r;
}

const FormatInfo& format_info(Format format) {
  const auto it = std::find_if(std::begin(kInfos), std::end(kInfos),
                               [&](const FormatInfo& i) { return i.format == format; });
  return it == std::end(kInfos) ? kInfos[0] : *it;
}

Format recognise(const ByteStream& stream, const std::string& name) {
  const std::string extension = extension_of(name);
  Cursor cursor(stream);
  const ByteSpan bytes = cursor.take(32);
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const Magic& m : kMagics) {
    if (!head.starts_with(m.bytes)) continue;
    if (m.format == Format::las) return is_laz(stream) ? Format::laz : Format::las;
    if (m.format != Format::gzip) return m.format;
    return by_name(extension == ".gz" ? extension_of(name.substr(0, name.size() - 3)) : extension,
                   Format::gzip);
  }
  if (is_ply(head)) return Format::ply;
  if (const Format f = by_class(head); f != Format::unknown) return f;
  if (is_pcd(stream)) return Format::pcd;
  if (const auto shape = recognise_text(stream)) {
    const bool lone_count = *shape == TextShape::pts;
    return lone_count && extension == ".ptx" ? Format::ptx
           : lone_count                      ? Format::pts
           : *shape == TextShape::ptx        ? Format::ptx
                                             : Format::xyz;
  }
  return by_name(extension, by_text_name(extension));
}

}  // namespace mapcodec
