// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mesh_ply.hpp"

#include <charconv>

#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/formats/file_sink.hpp"

namespace mapcodec {
namespace {

std::string header_of(const SurfaceMesh& mesh, const MeshWriteOptions& options) {
  const std::string number = options.doubles ? "double" : "float";
  std::string h = "ply\nformat ";
  h += options.ascii ? "ascii" : "binary_little_endian";
  h += " 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) + "\n";
  for (const char* axis : {"x", "y", "z"}) h += "property " + number + " " + axis + "\n";
  if (!mesh.rgb.empty()) h += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  h += "element face " + std::to_string(mesh.faces.size()) + "\n";
  return h + "property list uchar int vertex_indices\nend_header\n";
}

template <class T>
void add_number(T value, std::string& line) {
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  if (!line.empty()) line += ' ';
  line.append(text, end);
}

Status write_text(const SurfaceMesh& mesh, bool doubles, OutputFile& out) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    std::string line;
    for (const double v : mesh.vertices[i]) {
      if (doubles) {
        add_number(v, line);
      } else {
        add_number(static_cast<float>(v), line);
      }
    }
    for (std::size_t c = 0; c < 3 && !mesh.rgb.empty(); ++c) add_number(int(mesh.rgb[i][c]), line);
    MAPCODEC_TRY(out.append(line + "\n"));
  }
  for (const auto& face : mesh.faces) {
    std::string line = "3";
    for (const std::uint32_t v : face) add_number(v, line);
    MAPCODEC_TRY(out.append(line + "\n"));
  }
  return {};
}

Status write_binary(const SurfaceMesh& mesh, bool doubles, OutputFile& out) {
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    ByteWriter row;
    for (const double v : mesh.vertices[i]) {
      if (doubles) {
        row.f64(v);
      } else {
        row.f32(static_cast<float>(v));
      }
    }
    for (std::size_t c = 0; c < 3 && !mesh.rgb.empty(); ++c) row.u8(mesh.rgb[i][c]);
    MAPCODEC_TRY(out.append(row.bytes()));
  }
  for (const auto& face : mesh.faces) {
    ByteWriter row;
    row.u8(3);
    for (const std::uint32_t v : face) row.u32(v);
    MAPCODEC_TRY(out.append(row.bytes()));
  }
  return {};
}

}  // namespace

Status write_mesh_ply(const std::string& path, const SurfaceMesh& mesh, const MeshWriteOptions& options) {
  OutputFile out;
  MAPCODEC_TRY(out.open(path));
  MAPCODEC_TRY(out.append(header_of(mesh, options)));
  MAPCODEC_TRY((options.ascii ? write_text : write_binary)(mesh, options.doubles, out));
  return out.commit();
}

}  // namespace mapcodec
