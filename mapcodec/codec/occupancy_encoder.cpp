// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/occupancy_encoder.hpp"

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/occupancy_layout.hpp"
#include "mapcodec/entropy/range_encoder.hpp"

namespace mapcodec {
namespace {

using namespace occupancy;

struct EncoderSide {
  static constexpr bool kDecodes = false;
  RangeEncoder* out;

  bool bit(bool known, std::uint32_t p1) {
    out->encode(known, p1);
    return known;
  }
  std::uint64_t raw(std::uint64_t known, int count) {
    out->encode_raw(known, count);
    return known;
  }
  [[nodiscard]] static bool ok() { return true; }
};

/// The values that occur; of too many, the most frequent.
ValueTable table_of(const OccupancyTree& tree) {
  std::vector<std::uint32_t> all;
  for (const OccupancyLevel& l : tree.levels) {
    for (const std::uint32_t v : l.leaf_values) all.push_back(to_ordered(v));
  }
  std::sort(all.begin(), all.end());
  std::vector<std::pair<std::size_t, std::uint32_t>> runs;  // count, value
  for (std::size_t i = 0, end = 0; i < all.size(); i = end) {
    while (end < all.size() && all[end] == all[i]) ++end;
    runs.emplace_back(end - i, all[i]);
  }
  ValueTable table;
  table.escapes = runs.size() > kMostValues;
  if (table.escapes) {
    std::stable_sort(runs.begin(), runs.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    runs.resize(kMostValues - 1);
    std::sort(runs.begin(), runs.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  }
  for (const auto& run : runs) table.values.push_back(from_ordered(run.second));
  return table;
}

void write_table(ByteWriter& out, const ValueTable& table) {
  out.varint(table.values.size() * 2 + (table.escapes ? 1 : 0));
  std::uint64_t next = 0;
  for (const std::uint32_t v : table.values) {
    out.varint(to_ordered(v) - next);
    next = std::uint64_t{to_ordered(v)} + 1;
  }
}

bool has_exceptions(const OccupancyTree& tree) {
  bool found = false;
  summarise_nodes(tree, [&](unsigned h, std::size_t i, const NodeSummary& s) {
    const OccupancyLevel& l = tree.levels[h];
    found |= l.node_values[i] != s.value();
    found |= !l.node_colors.empty() && l.node_colors[i] != s.color();
  });
  return found;
}

struct CubeCollector {
  CellCorner low{~0u, ~0u, ~0u}, high{0, 0, 0};

  void node(unsigned, const CellCorner&, std::uint16_t, std::size_t) {}
  void leaf(unsigned height, const CellCorner& corner, Cell, std::size_t) {
    for (std::size_t d = 0; d < 3; ++d) {
      low[d] = std::min(low[d], corner[d]);
      high[d] = std::max(high[d], corner[d] + (1u << height));
    }
  }
};

}  // namespace

EncodedTile encode_occupancy_tile(const OccupancyPiece& piece, double resolution_m) {
  OccupancyTree tree = piece.tree;  // what codes in both directions wants to write, too
  const StreamHead head{tree.inner_count(), tree.leaf_count(), has_exceptions(tree)};
  EncodedTile tile;
  tile.codec = CodecId::occupancy;
  tile.points = tile.input_points = head.leaves;
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(CodecId::occupancy));
  out.u8(0);
  out.varint(head.leaves);
  out.u8(Form{tree.kind, tree.root, head.exceptions}.byte());
  out.u8(piece.key.level);
  for (const std::int32_t v : {piece.key.x, piece.key.y, piece.key.z})
    out.varint(static_cast<std::uint64_t>(v));
  out.varint(head.inner);
  const ValueTable table = tree.kind == OccupancyKind::binary ? ValueTable{} : table_of(tree);
  if (tree.kind != OccupancyKind::binary) write_table(out, table);
  RangeEncoder code;
  (void)Stream<EncoderSide>({&code}, head, table).run(tree).ok();  // only decoders meet errors
  out.raw(code.finish());
  tile.bytes = out.take();
  tile.geometry_bytes = tile.bytes.size();
  CubeCollector cubes;
  walk(tree, cubes, corner_of(piece.key));
  tile.bounds.add(center_of(cubes.low, 0, resolution_m));
  tile.bounds.add(center_of(cubes.high, 0, resolution_m));
  return tile;
}

}  // namespace mapcodec
