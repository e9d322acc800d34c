// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/index_codec.hpp"

#include <algorithm>
#include <cmath>

#include "maps/column_codec.hpp"
#include "maps/index_columns.hpp"
#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

using Column = std::vector<std::uint64_t>;
using Scales = std::array<double, 4>;

/// Collects the columns and remembers which of them are there.
class ColumnWriter {
 public:
  void always(const Column& values) { write_column(body_, values); }
  void optional(IndexColumn column, const Column& values) {
    if (std::all_of(values.begin(), values.end(), [](std::uint64_t v) { return v == 0; })) return;
    present_ = static_cast<std::uint16_t>(present_ | static_cast<std::uint16_t>(column));
    write_column(body_, values);
  }
  ByteWriter& part(IndexColumn column) {
    present_ = static_cast<std::uint16_t>(present_ | static_cast<std::uint16_t>(column));
    return body_;
  }
  ByteWriter& body() { return body_; }
  [[nodiscard]] std::uint16_t present() const { return present_; }

 private:
  ByteWriter body_;
  std::uint16_t present_ = 0;
};

template <class Items, class Get>
Column column_of(const Items& items, Get get) {
  Column values;
  values.reserve(items.size());
  for (const auto& item : items) values.push_back(static_cast<std::uint64_t>(get(item)));
  return values;
}

/// zigzag of the differences between neighbours, the first against 0.
template <class Items, class Get>
Column differences(const Items& items, Get get) {
  std::int64_t previous = 0;
  return column_of(items, [&](const auto& item) {
    const std::int64_t value = get(item);
    return zigzag(value - std::exchange(previous, value));
  });
}

void write_ids(ColumnWriter& out, const std::vector<IndexEntry>& set) {
  using E = const IndexEntry&;
  out.optional(IndexColumn::submap, differences(set, [](E e) { return std::int64_t{e.record.submap}; }));
  out.optional(IndexColumn::level, column_of(set, [](E e) { return e.record.key.level; }));
  out.optional(IndexColumn::x, differences(set, [](E e) { return std::int64_t{e.record.key.x}; }));
  out.optional(IndexColumn::y, differences(set, [](E e) { return std::int64_t{e.record.key.y}; }));
  out.optional(IndexColumn::z, differences(set, [](E e) { return std::int64_t{e.record.key.z}; }));
}

void write_bounds(ColumnWriter& out, const std::vector<IndexEntry>& set) {
  out.optional(IndexColumn::reach, column_of(set, [](const IndexEntry& e) { return e.bounds.reach; }));
  for (std::size_t d = 0; d < 3; ++d) {
    out.optional(nth_column(IndexColumn::bounds_x, d),
                 column_of(set, [d](const IndexEntry& e) { return e.bounds.axis[d] ^ kFullCube; }));
  }
}

Scales worst_errors(const std::vector<IndexEntry>& set) {
  Scales worst{};
  for (const IndexEntry& e : set) {
    const Scales errors = to_array(e.record.errors);
    for (std::size_t i = 0; i < 4; ++i) worst[i] = std::max(worst[i], errors[i]);
  }
  return worst;
}

/// The metadata's value serves as the scale where it is hardly larger than the worst tile's: eight bytes
/// saved.
bool serves_as_scale(double achieved, double worst) {
  return achieved >= worst && achieved <= 1.02 * worst;
}

/// Steps below the scale, so that the worst is 0.
std::uint64_t error_code(double error, const ErrorGrid& grid) {
  if (grid.steps == 0) return 0;
  return grid.steps - std::min(grid.steps, static_cast<std::uint64_t>(std::ceil(error / grid.unit)));
}

/// Returns the bits that say which scales were not stored.
std::uint8_t write_errors(ColumnWriter& out, const std::vector<IndexEntry>& set, const Scales& achieved) {
  Scales scale = worst_errors(set);
  unsigned shared = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (serves_as_scale(achieved[i], scale[i])) {
      shared |= 1u << i;
      scale[i] = achieved[i];
    } else if (i == 1) {
      out.body().f64(scale[i]);  // exact: a strict bound must not seem exceeded by rounding
    } else {
      const float stored = round_up_to_float(scale[i]);
      out.body().f32(stored);
      scale[i] = static_cast<double>(stored);
    }
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const ErrorGrid grid(scale[i]);
    out.optional(nth_column(IndexColumn::error_0, i), column_of(set, [&](const IndexEntry& e) {
                   return error_code(to_array(e.record.errors)[i], grid);
                 }));
  }
  return static_cast<std::uint8_t>(shared);
}

std::vector<SegmentRef> all_segments(const std::vector<IndexEntry>& set) {
  std::vector<SegmentRef> segments;
  for (const IndexEntry& e : set)
    segments.insert(segments.end(), e.record.segments.begin(), e.record.segments.end());
  return segments;
}

void write_segments(ColumnWriter& out, const std::vector<SegmentRef>& segments, std::uint64_t begin) {
  for (const SegmentRef& s : segments) out.body().u32(s.crc);
  out.always(column_of(segments, [](const SegmentRef& s) { return s.length; }));
  std::uint64_t expected = begin;
  out.optional(IndexColumn::gap, column_of(segments, [&](const SegmentRef& s) {
                 const auto gap =
                     static_cast<std::int64_t>(s.offset - std::exchange(expected, s.offset + s.length));
                 return zigzag(gap);
               }));
}

void write_dead(ColumnWriter& out, const std::vector<SegmentRef>& dead, std::uint64_t begin) {
  if (dead.empty()) return;
  ByteWriter& body = out.part(IndexColumn::dead);
  body.varint(dead.size());
  for (const SegmentRef& s : dead) {
    body.varint(s.offset - std::exchange(begin, s.offset + s.length));
    body.varint(s.length);
    body.u32(s.crc);
  }
}

void write_hashes(ByteWriter& out, const std::vector<IndexEntry>& set) {
  for (const IndexEntry& e : set) {
    for (const ContentHash& h : e.record.hashes) out.raw(h.bytes);
  }
}

/// Plain varints, at least five bytes a tile: a reader can hold the count against the bytes.
void write_removed(ByteWriter& out, const std::vector<TileId>& removed) {
  TileId last;
  for (const TileId& id : removed) {
    out.varint(id.submap - last.submap);
    out.varint(id.key.level);
    out.signed_varint(std::int64_t{id.key.x} - last.key.x);
    out.signed_varint(std::int64_t{id.key.y} - last.key.y);
    out.signed_varint(std::int64_t{id.key.z} - last.key.z);
    last = id;
  }
}

}  // namespace

Bytes encode_index(const IndexBlock& block, const IndexContext& context) {
  ColumnWriter columns;
  write_ids(columns, block.set);
  columns.always(column_of(block.set, [](const IndexEntry& e) { return e.record.codec; }));
  columns.always(column_of(block.set, [](const IndexEntry& e) { return e.record.points; }));
  columns.optional(IndexColumn::extra_segments,
                   column_of(block.set, [](const IndexEntry& e) { return e.record.segments.size() - 1; }));
  write_bounds(columns, block.set);
  const std::uint8_t shared = write_errors(columns, block.set, to_array(context.achieved));
  write_segments(columns, all_segments(block.set), context.segments_begin);
  write_dead(columns, block.dead, context.segments_begin);
  if (block.hashes) write_hashes(columns.body(), block.set);

  ByteWriter out;
  out.u8(static_cast<std::uint8_t>((block.delta ? kIndexDelta : 0) | (block.hashes ? kIndexHashes : 0) |
                                   shared << kIndexScaleShift));
  out.varint(block.tiles);
  if (block.delta) {
    out.varint(block.set.size());
    out.varint(block.removed.size());
    write_removed(out, block.removed);
  }
  out.u16(columns.present());
  out.raw(columns.body().bytes());
  return out.take();
}

}  // namespace mapcodec
