// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <limits>

#include "maps/column_codec.hpp"
#include "maps/index_codec.hpp"
#include "maps/index_columns.hpp"
#include "maps/metadata_codec.hpp"

namespace mapcodec {
namespace {

using Column = std::vector<std::uint64_t>;

Error malformed(const char* what, const ByteReader& in) {
  return make_error(ErrorCode::kMalformed, std::string("index: ") + what, in.offset());
}

/// Reads the columns that `present` names; the others are zeros.
class ColumnReader {
 public:
  ColumnReader(ByteReader& in, std::uint16_t present) : in_(in), present_(present) {}

  [[nodiscard]] bool has(IndexColumn column) const {
    return (present_ & static_cast<std::uint16_t>(column)) != 0;
  }
  Result<Column> always(std::size_t count, std::uint64_t most) {
    MAPCODEC_ASSIGN(Column values, read_column(in_, count));
    if (std::any_of(values.begin(), values.end(), [most](std::uint64_t v) { return v > most; })) {
      return malformed("a value is out of range", in_);
    }
    return values;
  }
  Result<Column> optional(IndexColumn column, std::size_t count, std::uint64_t most) {
    return has(column) ? always(count, most) : Result<Column>(Column(count));
  }
  ByteReader& in() { return in_; }

 private:
  ByteReader& in_;
  std::uint16_t present_;
};

/// Undoes `differences`; every value must lie in [low, high].
Status sum_up(Column& values, std::int64_t low, std::int64_t high, const ByteReader& in) {
  std::int64_t sum = 0;
  for (std::uint64_t& value : values) {
    sum += unzigzag(value);  // both within 2^33: no overflow
    if (sum < low || sum > high) return malformed("a key is out of range", in);
    value = static_cast<std::uint64_t>(sum);
  }
  return {};
}

template <class Int>
Result<Column> read_differences(ColumnReader& columns, IndexColumn column, std::size_t count) {
  MAPCODEC_ASSIGN(Column values, columns.optional(column, count, std::uint64_t{1} << 33));
  MAPCODEC_TRY(
      sum_up(values, std::numeric_limits<Int>::min(), std::numeric_limits<Int>::max(), columns.in()));
  return values;
}

bool is_valid(const TileKey& key) {
  return key.is_unplaced() ? key == TileKey::unplaced() : key.level <= kMaxTileLevel;
}

Status check_order(const std::vector<TileId>& ids, const ByteReader& in) {
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (!is_valid(ids[i].key)) return malformed("a tile's level is out of range", in);
    if (i > 0 && !TileIdLess()(ids[i - 1], ids[i])) return malformed("the tiles are out of order", in);
  }
  return {};
}

Result<std::vector<TileId>> read_ids(ColumnReader& columns, std::size_t count) {
  MAPCODEC_ASSIGN(const Column submap, read_differences<std::uint32_t>(columns, IndexColumn::submap, count));
  MAPCODEC_ASSIGN(const Column level, columns.optional(IndexColumn::level, count, 255));
  MAPCODEC_ASSIGN(const Column x, read_differences<std::int32_t>(columns, IndexColumn::x, count));
  MAPCODEC_ASSIGN(const Column y, read_differences<std::int32_t>(columns, IndexColumn::y, count));
  MAPCODEC_ASSIGN(const Column z, read_differences<std::int32_t>(columns, IndexColumn::z, count));
  std::vector<TileId> ids(count);
  for (std::size_t i = 0; i < count; ++i) {
    ids[i].submap = static_cast<std::uint32_t>(submap[i]);
    ids[i].key = {static_cast<std::int32_t>(x[i]), static_cast<std::int32_t>(y[i]),
                  static_cast<std::int32_t>(z[i]), static_cast<std::uint8_t>(level[i])};
  }
  MAPCODEC_TRY(check_order(ids, columns.in()));
  return ids;
}

Status read_facts(ColumnReader& columns, std::vector<IndexEntry>& set) {
  MAPCODEC_ASSIGN(const Column codec, columns.always(set.size(), 255));
  MAPCODEC_ASSIGN(const Column points, columns.always(set.size(), std::numeric_limits<std::uint64_t>::max()));
  for (std::size_t i = 0; i < set.size(); ++i) {
    set[i].record.codec = static_cast<std::uint8_t>(codec[i]);
    set[i].record.points = points[i];
  }
  return {};
}

/// Gives every tile its number of segments; the sum is bounded by the checksums that must follow.
Status read_segment_counts(ColumnReader& columns, std::vector<IndexEntry>& set) {
  MAPCODEC_ASSIGN(const Column extra,
                  columns.optional(IndexColumn::extra_segments, set.size(), kMaxSegmentBytes));
  std::uint64_t room = columns.in().left() / 4;
  for (std::size_t i = 0; i < set.size(); ++i) {
    if (extra[i] >= room) return malformed("more segments than bytes", columns.in());
    room -= extra[i] + 1;
  }
  for (std::size_t i = 0; i < set.size(); ++i) set[i].record.segments.resize(extra[i] + 1);
  return {};
}

Status read_bounds(ColumnReader& columns, std::vector<IndexEntry>& set, const IndexContext& context) {
  MAPCODEC_ASSIGN(const Column reach, columns.optional(IndexColumn::reach, set.size(), kMaxReach));
  for (std::size_t i = 0; i < set.size(); ++i) set[i].bounds.reach = static_cast<std::uint8_t>(reach[i]);
  for (std::size_t d = 0; d < 3; ++d) {
    MAPCODEC_ASSIGN(const Column axis,
                    columns.optional(nth_column(IndexColumn::bounds_x, d), set.size(), 255));
    for (std::size_t i = 0; i < set.size(); ++i)
      set[i].bounds.axis[d] = static_cast<std::uint8_t>(axis[i] ^ kFullCube);
  }
  for (IndexEntry& e : set) {
    if (!is_valid(e.bounds)) return malformed("a tile's bounds are inside out", columns.in());
    e.record.bounds = decode_bounds(e.bounds, e.record.key, context.origin, context.tile_size_m);
  }
  return {};
}

Result<std::array<double, 4>> read_scales(ByteReader& in, unsigned shared, const TileErrors& achieved) {
  std::array<double, 4> scale = to_array(achieved);
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(shared >> i & 1)) scale[i] = i == 1 ? in.f64() : static_cast<double>(in.f32());
    if (!(scale[i] >= 0) || !std::isfinite(scale[i]))
      return malformed("an error is negative or not finite", in);
  }
  MAPCODEC_TRY(in.status("index"));
  return scale;
}

Status read_errors(ColumnReader& columns, std::vector<IndexEntry>& set, unsigned shared,
                   const TileErrors& achieved) {
  MAPCODEC_ASSIGN(const auto scale, read_scales(columns.in(), shared, achieved));
  std::vector<std::array<double, 4>> errors(set.size());
  for (std::size_t i = 0; i < 4; ++i) {
    const ErrorGrid grid(scale[i]);
    MAPCODEC_ASSIGN(const Column codes,
                    columns.optional(nth_column(IndexColumn::error_0, i), set.size(), grid.steps));
    for (std::size_t t = 0; t < set.size(); ++t) {
      errors[t][i] = std::min(scale[i], static_cast<double>(grid.steps - codes[t]) * grid.unit);
    }
  }
  for (std::size_t t = 0; t < set.size(); ++t) set[t].record.errors = to_errors(errors[t]);
  return {};
}

bool lies_within(const SegmentRef& s, std::uint64_t begin, std::uint64_t end) {
  return s.length > 0 && s.length <= kMaxSegmentBytes && s.offset >= begin && s.offset <= end &&
         s.length <= end - s.offset;
}

Status read_segments(ColumnReader& columns, std::vector<IndexEntry>& set, const IndexContext& context) {
  std::vector<SegmentRef*> segments;
  for (IndexEntry& e : set) {
    for (SegmentRef& s : e.record.segments) segments.push_back(&s);
  }
  for (SegmentRef* s : segments) s->crc = columns.in().u32();
  MAPCODEC_TRY(columns.in().status("index"));
  MAPCODEC_ASSIGN(const Column lengths, columns.always(segments.size(), kMaxSegmentBytes));
  MAPCODEC_ASSIGN(const Column gaps,
                  columns.optional(IndexColumn::gap, segments.size(), std::uint64_t{1} << 62));
  std::uint64_t expected = context.segments_begin;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    segments[i]->length = static_cast<std::uint32_t>(lengths[i]);
    segments[i]->offset = expected + static_cast<std::uint64_t>(unzigzag(gaps[i]));  // may wrap; checked next
    if (!lies_within(*segments[i], 8, context.segments_end))
      return malformed("a segment lies outside the file", columns.in());
    expected = segments[i]->offset + segments[i]->length;
  }
  return {};
}

Result<std::vector<SegmentRef>> read_dead(ColumnReader& columns, const IndexContext& context) {
  std::vector<SegmentRef> dead;
  if (!columns.has(IndexColumn::dead)) return dead;
  ByteReader& in = columns.in();
  const std::uint64_t count = in.varint();
  if (!in.ok() || count > in.left() / 6) return malformed("more dead ranges than bytes", in);
  std::uint64_t begin = context.segments_begin;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t gap = in.varint(), length = in.varint();
    const std::uint32_t crc = in.u32();
    if (gap > context.segments_end || length > kMaxSegmentBytes)
      return malformed("a dead range lies outside the commit", in);
    dead.push_back({begin + gap, static_cast<std::uint32_t>(length), crc});
    if (!lies_within(dead.back(), begin, context.segments_end))
      return malformed("a dead range lies outside the commit", in);
    begin = dead.back().offset + length;
  }
  MAPCODEC_TRY(in.status("index"));
  return dead;
}

Status read_hashes(ByteReader& in, std::vector<IndexEntry>& set) {
  for (IndexEntry& e : set) {
    if (e.record.segments.size() > in.left() / sizeof(ContentHash::bytes))
      return malformed("more segments than hashes", in);
    e.record.hashes.resize(e.record.segments.size());
    for (ContentHash& h : e.record.hashes) {
      const ByteSpan stored = in.raw(h.bytes.size());
      std::copy(stored.begin(), stored.end(), h.bytes.begin());
    }
  }
  return {};
}

/// The fields before the columns.
struct Front {
  std::uint8_t kind = 0;
  std::uint64_t tiles = 0, set = 0, removed = 0;
};

Result<Front> read_front(ByteReader& in) {
  Front front;
  front.kind = in.u8();
  front.tiles = front.set = in.varint();
  if (front.kind & kIndexDelta) {
    front.set = in.varint();
    front.removed = in.varint();
  }
  MAPCODEC_TRY(in.status("index"));
  if ((front.kind & 0x0C) != 0) return malformed("unknown kind", in);
  return front;
}

/// Before anything is allocated: a tile needs four bytes of checksum, a removed one five of its key.
Status check_counts(const Front& front, const ByteReader& in, const DecodeLimits& limits) {
  if (front.set > in.left() / 4 || front.removed > in.left() / 5)
    return malformed("more tiles than bytes", in);
  constexpr std::uint64_t kEntry =
      sizeof(IndexEntry) + sizeof(SegmentRef) + 64;  // with columns and allocator
  if (front.set <= limits.max_bytes / kEntry) return {};
  return make_error(ErrorCode::kLimitExceeded, "index: too many tiles");
}

Result<std::vector<TileId>> read_removed(ByteReader& in, std::uint64_t count) {
  std::vector<TileId> ids;
  std::uint64_t submap = 0;
  std::array<std::int64_t, 3> at{};
  for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
    const std::uint64_t step = in.varint(), level = in.varint();
    if (step > std::numeric_limits<std::uint32_t>::max() - submap || level > 255)
      return malformed("a key is out of range", in);
    submap += step;
    for (std::int64_t& v : at) {
      const std::uint64_t difference = in.varint();
      if (difference > std::uint64_t{1} << 33) return malformed("a key is out of range", in);
      v += unzigzag(difference);
      if (v != static_cast<std::int32_t>(v)) return malformed("a key is out of range", in);
    }
    ids.push_back({static_cast<std::uint32_t>(submap),
                   {static_cast<std::int32_t>(at[0]), static_cast<std::int32_t>(at[1]),
                    static_cast<std::int32_t>(at[2]), static_cast<std::uint8_t>(level)}});
  }
  MAPCODEC_TRY(in.status("index"));
  MAPCODEC_TRY(check_order(ids, in));
  return ids;
}

}  // namespace

Result<IndexHead> decode_index_head(ByteSpan bytes) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const Front front, read_front(in));
  return IndexHead{(front.kind & kIndexDelta) != 0, (front.kind & kIndexHashes) != 0, front.tiles};
}

Result<IndexBlock> decode_index(ByteSpan bytes, const IndexContext& context, const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const Front front, read_front(in));
  MAPCODEC_TRY(check_counts(front, in, limits));
  IndexBlock block{
      (front.kind & kIndexDelta) != 0, (front.kind & kIndexHashes) != 0, front.tiles, {}, {}, {}};
  MAPCODEC_ASSIGN(block.removed, read_removed(in, front.removed));
  ColumnReader columns(in, in.u16());
  MAPCODEC_TRY(in.status("index"));
  MAPCODEC_ASSIGN(const std::vector<TileId> ids, read_ids(columns, front.set));
  block.set.resize(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    block.set[i].record.submap = ids[i].submap;
    block.set[i].record.key = ids[i].key;
  }
  MAPCODEC_TRY(read_facts(columns, block.set));
  MAPCODEC_TRY(read_segment_counts(columns, block.set));
  MAPCODEC_TRY(read_bounds(columns, block.set, context));
  MAPCODEC_TRY(read_errors(columns, block.set, front.kind >> kIndexScaleShift, context.achieved));
  MAPCODEC_TRY(read_segments(columns, block.set, context));
  MAPCODEC_ASSIGN(block.dead, read_dead(columns, context));
  if (block.hashes) MAPCODEC_TRY(read_hashes(in, block.set));
  if (in.left() > 0) return malformed("bytes are left over", in);
  return block;
}

}  // namespace mapcodec
