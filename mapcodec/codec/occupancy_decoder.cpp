// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/occupancy_decoder.hpp"

#include <bit>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/codec/occupancy_layout.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/entropy/range_decoder.hpp"
#include "mapcodec/entropy/rans_decoder.hpp"

namespace mapcodec {
namespace {

using namespace occupancy;

struct BitDecoder {
  static constexpr bool kDecodes = true, kValued = false;
  RangeDecoder in;

  bool bit(bool, std::uint32_t p1) { return in.decode(p1); }
  [[nodiscard]] bool ok() const { return in.ok(); }
};

struct SymbolDecoder {
  static constexpr bool kDecodes = true, kValued = true;
  RansDecoder in;

  bool bit(bool, BitModel& model) { return in.decode(model); }
  std::uint32_t nibble(std::uint32_t, NibbleModel& model) { return in.decode(model); }
  std::uint32_t nibble(std::uint32_t, NibbleModel& a, NibbleModel& b) { return in.decode(a, b); }
  std::uint32_t raw(std::uint32_t, int count) { return in.decode_raw(count); }
  static std::uint32_t rank_of(std::uint32_t) { return 0; }
  [[nodiscard]] bool ok() const { return in.ok(); }
};

Error malformed(const char* what, const ByteReader& in) {
  return make_error(ErrorCode::kMalformed, std::string("occupancy tile: ") + what, in.offset());
}

Result<TileKey> read_key(ByteReader& in) {
  const std::uint8_t height = in.u8();
  const std::uint64_t v[3] = {in.varint(), in.varint(), in.varint()};
  MAPCODEC_TRY(in.status("occupancy tile"));
  if (height > kOccupancyHeight) return malformed("it is higher than a tree", in);
  for (const std::uint64_t x : v) {
    if (x >> (kOccupancyHeight - height) != 0) return malformed("it lies outside of the tree", in);
  }
  return TileKey{static_cast<std::int32_t>(v[0]), static_cast<std::int32_t>(v[1]),
                 static_cast<std::int32_t>(v[2]), height};
}

Result<ValueTable> read_table(ByteReader& in, std::uint64_t leaves) {
  const std::uint64_t head = in.varint();
  const std::uint64_t count = head >> 1;
  if (!in.ok() || count > kMostValues || count > in.left() || count > leaves || head == 0)
    return malformed("wrong number of log-odds", in);
  std::vector<ValueTable::Entry> entries;
  std::uint64_t v = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    v += in.varint() + (i > 0 ? 1 : 0);
    if (v > 0xffffffffu) return malformed("log-odds out of range", in);
    entries.push_back({from_ordered(static_cast<std::uint32_t>(v)), in.u8()});
    if (entries.back().weight < 1 || entries.back().weight > 32)
      return malformed("log-odds without a weight", in);
  }
  const std::uint8_t escapes = (head & 1) != 0 ? in.u8() : 0;
  MAPCODEC_TRY(in.status("occupancy tile"));
  if (escapes > 32 || ((head & 1) != 0 && escapes == 0)) return malformed("log-odds without a weight", in);
  return ValueTable(std::move(entries), escapes);
}

/// Memory that a tree of so many nodes takes while it is decoded.
std::uint64_t memory_for(const StreamHead& head, OccupancyKind kind) {
  const std::uint64_t leaf =
      kind == OccupancyKind::binary ? 0 : 4 + 4 + (kind == OccupancyKind::color ? 3 : 0);
  const std::uint64_t board = kind == OccupancyKind::binary ? 0 : 8 + (kind == OccupancyKind::color ? 32 : 0);
  return head.inner * (2 * (sizeof(Beside) + 10) + 2 + leaf + board) + head.leaves * leaf;
}

Status check_form(const Form& form, const StreamHead& head, std::uint8_t height, const DecodeLimits& limits,
                  const ByteReader& in) {
  const bool inner = form.root == Cell::inner;
  if (form.kind < OccupancyKind::binary || form.kind > OccupancyKind::color || form.root == Cell::unknown)
    return malformed("unknown kind", in);
  if (inner ? head.inner == 0 || height == 0 : head.inner != 0 || head.leaves != 1)
    return malformed("its root contradicts its counts", in);
  // Each inner node has a child; leaves and inner nodes but the root are children.
  if (head.leaves == 0 || head.leaves > 8 * head.inner + 1 || head.inner > kOccupancyHeight * head.leaves)
    return malformed("impossible number of nodes", in);
  if (head.leaves > limits.max_points || memory_for(head, form.kind) > limits.max_bytes)
    return make_error(ErrorCode::kLimitExceeded, "occupancy tile would need too much memory", in.offset());
  return {};
}

template <class T>
void add_channel(PointCloud& cloud, const ChannelSchema& schema, const std::vector<T>& values) {
  Channel c{schema.info, Bytes(values.size() * sizeof(T))};
  if (!values.empty()) std::memcpy(c.data.data(), values.data(), c.data.size());
  cloud.channels.push_back(std::move(c));
}

/// Collects leaves depth first.
struct LeafCollector {
  const OccupancyTree& tree;
  double resolution_m;
  std::vector<Vec3> centers{};
  std::vector<std::uint8_t> occupied{}, heights{};
  std::vector<std::uint32_t> values{};
  std::vector<OccupancyColor> colors{};

  void node(unsigned, const CellCorner&, std::uint16_t, std::size_t) {}
  void leaf(unsigned height, const CellCorner& corner, Cell cell, std::size_t k) {
    centers.push_back(center_of(corner, double(1u << height), resolution_m));
    occupied.push_back(cell == Cell::occupied ? 1 : 0);
    heights.push_back(static_cast<std::uint8_t>(height));
    const OccupancyLevel& level = tree.levels[height];
    if (!level.leaf_values.empty()) values.push_back(level.leaf_values[k]);
    if (!level.leaf_colors.empty()) colors.push_back(level.leaf_colors[k]);
  }
};

ChannelSchema exact_channel(const char* name, ScalarType type, std::uint8_t components) {
  ChannelSchema c;
  c.info = {name, type, components};
  return c;
}

}  // namespace

Result<OccupancyPiece> decode_occupancy(ByteSpan section, std::uint64_t leaves, const DecodeLimits& limits) {
  ByteReader in(section);
  const std::uint8_t first = in.u8();
  const Form form = Form::from(first);
  if (std::uint8_t(first | Form::kSymbols) == form.byte() && first != form.byte())
    return make_error(ErrorCode::kUnsupported,
                      "occupancy tile: log-odds in the code of an earlier version; compress the .ot again");
  if (first != form.byte()) return malformed("unknown form", in);
  OccupancyPiece piece;
  MAPCODEC_ASSIGN(piece.key, read_key(in));
  const StreamHead head{in.varint(), leaves, form.exceptions};
  MAPCODEC_TRY(in.status("occupancy tile"));
  MAPCODEC_TRY(check_form(form, head, piece.key.level, limits, in));
  ValueTable table;
  if (form.kind != OccupancyKind::binary) {
    MAPCODEC_ASSIGN(table, read_table(in, leaves));
  }
  piece.tree.kind = form.kind;
  piece.tree.root = form.root;
  piece.tree.height = piece.key.level;
  if (form.kind == OccupancyKind::binary) {
    BitDecoder side{RangeDecoder(in.raw(in.left()))};
    MAPCODEC_TRY(Stream<BitDecoder>(side, head, table).run(piece.tree));
    return piece;
  }
  SymbolDecoder side{RansDecoder(in.raw(in.left()))};
  MAPCODEC_TRY(Stream<SymbolDecoder>(side, head, table).run(piece.tree));
  if (!side.in.finished()) return malformed("its code ends where it should not", in);
  return piece;
}

Result<OccupancyPiece> decode_occupancy_tile(ByteSpan bytes, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const TileSections s, read_tile_sections(bytes, MapSchema{}, limits));
  if (s.header.codec != CodecId::occupancy)
    return make_error(ErrorCode::kMalformed,
                      std::string("a tile of codec ") + codec_name(s.header.codec) + " holds no occupancy",
                      0);
  return decode_occupancy(s.geometry, s.header.points, limits);
}

Result<PointCloud> occupancy_points(const OccupancyPiece& piece, const MapSchema& schema,
                                    const DecodeLimits& limits) {
  if (occupancy_kind(schema) != piece.tree.kind)
    return make_error(ErrorCode::kMalformed, "the map's schema does not fit its occupancy tiles");
  if (piece.tree.leaf_count() * 64 > limits.max_bytes)
    return make_error(ErrorCode::kLimitExceeded, "occupancy tile would need too much memory");
  LeafCollector all{piece.tree, schema.tile_size_m};
  walk(piece.tree, all, corner_of(piece.key));
  PointCloud cloud;
  cloud.coordinates = schema.coordinates;
  cloud.xyz = std::move(all.centers);
  if (piece.tree.kind == OccupancyKind::binary)
    add_channel(cloud, schema.channels[0], all.occupied);
  else
    add_channel(cloud, schema.channels[0], all.values);
  add_channel(cloud, schema.channels[1], all.heights);
  if (piece.tree.kind == OccupancyKind::color) add_channel(cloud, schema.channels[2], all.colors);
  return cloud;
}

MapSchema occupancy_schema(OccupancyKind kind, double resolution_m) {
  MapSchema s;
  s.promise = PromiseKind::lossless;
  s.tile_size_m = resolution_m;
  s.origin.fill(-32768 * resolution_m);
  s.coordinates.kind = CoordinateFormat::Kind::f64;
  s.occupancy = kind;
  s.channels.push_back(kind == OccupancyKind::binary ? exact_channel("occupied", ScalarType::u8, 1)
                                                     : exact_channel("log_odds", ScalarType::f32, 1));
  s.channels.push_back(exact_channel("height", ScalarType::u8, 1));
  if (kind == OccupancyKind::color) s.channels.push_back(exact_channel("rgb", ScalarType::u8, 3));
  return s;
}

std::optional<OccupancyKind> occupancy_kind(const MapSchema& schema) {
  if (!schema.occupancy || !(schema == occupancy_schema(*schema.occupancy, schema.tile_size_m)))
    return std::nullopt;
  return schema.occupancy;
}

}  // namespace mapcodec
