// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "mapcodec/base/byte_writer.hpp"
#include "slam_adapter/formats/detect.hpp"
#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/octomap/octree_file.hpp"

namespace mapcodec {
namespace {

/// As a C++ stream writes it (six digits), unless that would be another number.
std::string resolution_text(double v) {
  char text[40];
  std::snprintf(text, sizeof text, "%g", v);
  if (std::strtod(text, nullptr) != v) std::snprintf(text, sizeof text, "%.17g", v);
  return text;
}

std::string header_text(const OccupancyTree& tree, double resolution_m, OctreeFormat format) {
  const bool binary = format == OctreeFormat::bt;
  const bool color = tree.kind == OccupancyKind::color;
  return std::string("# Octomap OcTree ") + (binary ? "binary " : "") +
         "file\n# (feel free to add / change comments, but leave the first line as it is!)\n#\nid " +
         (color ? "ColorOcTree" : "OcTree") + "\nsize " +
         std::to_string(tree.inner_count() + tree.leaf_count()) + "\nres " + resolution_text(resolution_m) +
         "\ndata\n";
}

/// The .bt stream: two bytes an inner node, depth first.
struct BinaryNodes {
  ByteWriter& out;
  void leaf(unsigned, const CellCorner&, Cell, std::size_t) {}
  void node(unsigned, const CellCorner&, std::uint16_t node, std::size_t) { out.u16(node); }
};

struct FullNodes {
  const OccupancyTree& tree;
  ByteWriter& out;

  void leaf(unsigned height, const CellCorner&, Cell, std::size_t k) {
    const OccupancyLevel& l = tree.levels[height];
    content(l.leaf_values[k], l.leaf_colors, k);
    out.u8(0);
  }
  void node(unsigned height, const CellCorner&, std::uint16_t node, std::size_t k) {
    const OccupancyLevel& l = tree.levels[height];
    content(l.node_values[k], l.node_colors, k);
    unsigned mask = 0;
    for (unsigned i = 0; i < 8; ++i) mask |= cell_of(node, i) != Cell::unknown ? 1u << i : 0u;
    out.u8(static_cast<std::uint8_t>(mask));
  }
  void content(std::uint32_t value, const std::vector<OccupancyColor>& colors, std::size_t k) {
    out.u32(value);
    if (tree.kind == OccupancyKind::color) out.raw(colors[k]);
  }
};

float log_odds(double probability) {
  return static_cast<float>(std::log(probability / (1 - probability)));
}

}  // namespace

OccupancyTree with_log_odds(OccupancyTree tree) {
  if (tree.kind != OccupancyKind::binary) return tree;
  // OctoMap's default clamping thresholds.
  const auto free = std::bit_cast<std::uint32_t>(log_odds(0.1192));
  const auto occupied = std::bit_cast<std::uint32_t>(log_odds(0.971));
  tree.kind = OccupancyKind::log_odds;
  if (tree.root != Cell::inner)
    tree.levels[tree.height].leaf_values = {tree.root == Cell::free ? free : occupied};
  for (unsigned h = 1; h <= tree.height; ++h) {
    for (const std::uint16_t node : tree.levels[h].nodes) {
      for (unsigned c = 0; c < 8; ++c) {
        const Cell cell = cell_of(node, c);
        if (cell == Cell::free || cell == Cell::occupied)
          tree.levels[h - 1].leaf_values.push_back(cell == Cell::free ? free : occupied);
      }
    }
    tree.levels[h].node_values.resize(tree.levels[h].nodes.size());
  }
  summarise_nodes(tree, [&](unsigned h, std::size_t i, const NodeSummary& s) {
    tree.levels[h].node_values[i] = s.value();
  });
  return tree;
}

Bytes format_octree(const OccupancyTree& tree, double resolution_m, OctreeFormat format) {
  if (format == OctreeFormat::ot && tree.kind == OccupancyKind::binary)
    return format_octree(with_log_odds(tree), resolution_m, format);
  ByteWriter out;
  const std::string header = header_text(tree, resolution_m, format);
  out.raw(ByteSpan(reinterpret_cast<const std::uint8_t*>(header.data()), header.size()));
  if (format == OctreeFormat::bt)
    walk(tree, BinaryNodes{out});
  else
    walk(tree, FullNodes{tree, out});
  return out.take();
}

Status write_octree(const std::string& path, const OccupancyTree& tree, double resolution_m) {
  if (!is_octree_name(path))
    return make_error(ErrorCode::kInvalidArgument, "an octree is written to a name that ends in .bt or .ot");
  const OctreeFormat format = extension_of(path) == ".bt" ? OctreeFormat::bt : OctreeFormat::ot;
  OutputFile file;
  MAPCODEC_TRY(file.open(path));
  MAPCODEC_TRY(file.append(format_octree(tree, resolution_m, format)));
  return file.commit();
}

}  // namespace mapcodec
