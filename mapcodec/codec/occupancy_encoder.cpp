// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/occupancy_encoder.hpp"

#include <bit>

#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/occupancy_layout.hpp"
#include "mapcodec/entropy/range_encoder.hpp"
#include "mapcodec/entropy/rans_encoder.hpp"

namespace mapcodec {
namespace {

using namespace occupancy;

/// Finds the rank of a value: a hash table, since each leaf asks.
class RankIndex {
 public:
  explicit RankIndex(const ValueTable& table) : places_(std::bit_ceil(2 * table.entries().size() + 1)) {
    for (std::uint32_t o = 0; o < 2; ++o) {
      const std::uint32_t escape = table.escapes() > 0 ? 1 : 0;
      escape_[o] = table.ranks(o) - escape;
      for (std::uint32_t r = 0; r < escape_[o]; ++r) find(table.value(o, r)) = {table.value(o, r), r + 1};
    }
  }
  /// Of a value that stands in the table, or the escape.
  [[nodiscard]] std::uint32_t rank_of(std::uint32_t bits) {
    const Place& p = find(bits);
    return p.rank > 0 ? p.rank - 1 : escape_[ValueTable::class_of(bits)];
  }

 private:
  struct Place {
    std::uint32_t bits = 0, rank = 0;  ///< rank + 1; 0: nothing here
  };
  Place& find(std::uint32_t bits) {
    std::size_t i = bits * 0x9E3779B1u >> 7;
    for (;; ++i) {
      Place& p = places_[i & (places_.size() - 1)];
      if (p.rank == 0 || p.bits == bits) return p;
    }
  }

  std::vector<Place> places_;
  std::array<std::uint32_t, 2> escape_{};
};

struct BitEncoder {
  static constexpr bool kDecodes = false, kValued = false;
  RangeEncoder* out;

  bool bit(bool known, std::uint32_t p1) {
    out->encode(known, p1);
    return known;
  }
  [[nodiscard]] static bool ok() { return true; }
};

struct SymbolEncoder {
  static constexpr bool kDecodes = false, kValued = true;
  RansEncoder* out;
  RankIndex* ranks;

  bool bit(bool known, BitModel& model) {
    out->encode(known, model);
    return known;
  }
  std::uint32_t nibble(std::uint32_t known, NibbleModel& model) {
    out->encode(known, model);
    return known;
  }
  std::uint32_t nibble(std::uint32_t known, NibbleModel& a, NibbleModel& b) {
    out->encode(known, a, b);
    return known;
  }
  std::uint32_t raw(std::uint32_t known, int count) {
    out->encode_raw(known, count);
    return known;
  }
  std::uint32_t rank_of(std::uint32_t value) { return ranks->rank_of(value); }
  [[nodiscard]] static bool ok() { return true; }
};

/// The code of a tree; streams for both directions want to write to it, too, but do not.
Bytes code_tree(OccupancyTree& tree, const StreamHead& head, const ValueTable& table) {
  if (tree.kind == OccupancyKind::binary) {
    RangeEncoder out;
    BitEncoder side{&out};
    (void)Stream<BitEncoder>(side, head, table).run(tree).ok();  // only decoders meet errors
    return out.finish();
  }
  RansEncoder out;
  RankIndex ranks(table);
  SymbolEncoder side{&out, &ranks};
  (void)Stream<SymbolEncoder>(side, head, table).run(tree).ok();
  return out.finish();
}

std::uint8_t weight_of(std::size_t count) {
  return static_cast<std::uint8_t>(std::min<std::size_t>(std::bit_width(count), 32));
}

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
  std::size_t escaped = all.size();
  if (runs.size() > kMostValues) {
    std::stable_sort(runs.begin(), runs.end(),
                     [](const auto& a, const auto& b) { return a.first > b.first; });
    runs.resize(kMostValues - 1);
    std::sort(runs.begin(), runs.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  }
  std::vector<ValueTable::Entry> entries;
  for (const auto& [count, value] : runs) {
    entries.push_back({from_ordered(value), weight_of(count)});
    escaped -= count;
  }
  return {std::move(entries), weight_of(escaped)};
}

void write_table(ByteWriter& out, const ValueTable& table) {
  out.varint(table.entries().size() * 2 + (table.escapes() > 0 ? 1 : 0));
  std::uint64_t next = 0;
  for (const ValueTable::Entry& e : table.entries()) {
    out.varint(to_ordered(e.bits) - next);
    out.u8(e.weight);
    next = std::uint64_t{to_ordered(e.bits)} + 1;
  }
  if (table.escapes() > 0) out.u8(table.escapes());
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
  OccupancyTree tree = piece.tree;
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
  out.raw(code_tree(tree, head, table));
  tile.bytes = out.take();
  tile.geometry_bytes = tile.bytes.size();
  CubeCollector cubes;
  walk(tree, cubes, corner_of(piece.key));
  tile.bounds.add(center_of(cubes.low, 0, resolution_m));
  tile.bounds.add(center_of(cubes.high, 0, resolution_m));
  return tile;
}

}  // namespace mapcodec
