// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/metadata_codec.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapcodec {
namespace {

// Bits of the first field: which optional parts follow.
constexpr std::uint16_t kHasErrors[4] = {1, 2, 4, 8};  // one bit for each error that is not zero
constexpr std::uint16_t kHasBounds = 16;
constexpr std::uint16_t kPlacedInSchema = 32;  // origin and tile size stand in the schema's bytes
constexpr std::uint16_t kHasFlags = 64;
constexpr std::uint16_t kHasSubmaps = 128;
constexpr std::uint16_t kHasSnapshots = 256;
constexpr std::uint16_t kHasExtras = 512;
constexpr std::uint16_t kKnown = 1023;

constexpr double kMaxError = std::numeric_limits<float>::max();
constexpr int kBoundsBits = 20;  // the map's bounds are multiples of tile_size / 2^20
constexpr double kMaxBoundsUnits =
    0x1p51;  // when writing; a reader allows twice as much, for rounding outward
constexpr std::size_t kLeastSubmap = 1 + 9 * 8, kLeastSnapshot = 2, kLeastExtra = 2;

Error malformed(const char* what, const ByteReader& in) {
  return make_error(ErrorCode::kMalformed, std::string("map metadata: ") + what, in.offset());
}
Error invalid(const char* what) {
  return make_error(ErrorCode::kInvalidArgument, std::string("map facts: ") + what);
}

/// A double whose low bytes are zero is short: a count, then that many of its high bytes.
void write_short_double(ByteWriter& out, double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  const int zeros = bits == 0 ? 8 : std::countr_zero(bits) / 8;
  out.u8(static_cast<std::uint8_t>(8 - zeros));
  for (int i = zeros; i < 8; ++i) out.u8(static_cast<std::uint8_t>(bits >> (8 * i)));
}
double read_short_double(ByteReader& in) {
  const std::uint8_t count = in.u8();
  const ByteSpan high = in.raw(count);
  if (!in.ok() || count > 8) {
    in.raw(std::numeric_limits<std::uint64_t>::max());  // a longer one is no number: fail for good
    return 0;
  }
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < high.size(); ++i) bits |= std::uint64_t{high[i]} << (8 * (8 - count + i));
  return std::bit_cast<double>(bits);
}

Bytes placement(const MapInfo& info) {
  ByteWriter out;
  for (const double v : info.origin) out.f64(v);
  out.f64(info.tile_size_m);
  return out.take();
}
/// Where the schema's bytes happen to hold the placement, if they do: found by comparing bytes, not by
/// understanding them.
std::optional<std::size_t> find_placement(const MapInfo& info) {
  const Bytes wanted = placement(info);
  const auto at = std::search(info.schema.begin(), info.schema.end(), wanted.begin(), wanted.end());
  if (at == info.schema.end()) return std::nullopt;
  return static_cast<std::size_t>(at - info.schema.begin());
}

double unit_of(const MapInfo& info) {
  return std::ldexp(info.tile_size_m, -kBoundsBits);
}
double edge(const MapInfo& info, std::size_t d, std::int64_t k) {
  return info.origin[d] + static_cast<double>(k) * unit_of(info);
}
/// The last multiple whose *decoded* value is not above `value`: exactly idempotent.
std::int64_t round_down(const MapInfo& info, std::size_t d, double value) {
  auto k = static_cast<std::int64_t>(std::floor((value - info.origin[d]) / unit_of(info))) + 2;
  while (edge(info, d, k) > value) --k;
  return k;
}
std::int64_t round_up(const MapInfo& info, std::size_t d, double value) {
  auto k = static_cast<std::int64_t>(std::ceil((value - info.origin[d]) / unit_of(info))) - 2;
  while (edge(info, d, k) < value) ++k;
  return k;
}

void write_bounds(ByteWriter& out, const MapInfo& info) {
  for (std::size_t d = 0; d < 3; ++d) {
    const std::int64_t low = round_down(info, d, info.bounds.min[d]);
    out.signed_varint(low);
    out.varint(static_cast<std::uint64_t>(round_up(info, d, info.bounds.max[d]) - low));
  }
}
Status read_bounds(ByteReader& in, MapInfo& info) {
  for (std::size_t d = 0; d < 3; ++d) {
    const std::int64_t low = in.signed_varint();
    const std::uint64_t extent = in.varint();
    constexpr auto kMost = static_cast<std::int64_t>(4 * kMaxBoundsUnits);
    if (low < -kMost || low > kMost || extent > std::uint64_t{kMost})
      return malformed("bounds out of range", in);
    info.bounds.min[d] = edge(info, d, low);
    info.bounds.max[d] = edge(info, d, low + static_cast<std::int64_t>(extent));
  }
  return in.status("map metadata");
}

void write_errors(ByteWriter& out, const TileErrors& errors) {
  const auto e = to_array(errors);
  for (std::size_t i = 0; i < 4; ++i) {
    if (e[i] == 0) continue;
    i == 1 ? out.f64(e[i])
           : out.f32(round_up_to_float(e[i]));  // a strict bound must not seem exceeded by rounding
  }
}
TileErrors read_errors(ByteReader& in, std::uint16_t parts) {
  std::array<double, 4> e{};
  for (std::size_t i = 0; i < 4; ++i) {
    if (parts & kHasErrors[i]) e[i] = i == 1 ? in.f64() : static_cast<double>(in.f32());
  }
  return to_errors(e);
}

void write_submap(ByteWriter& out, const Submap& s) {
  out.text(s.name);
  for (const double v : s.translation_m) out.f64(v);
  for (const double v : s.rotation_xyzw) out.f64(v);
  out.f64(s.first_stamp_s);
  out.f64(s.last_stamp_s);
}
Submap read_submap(ByteReader& in) {
  Submap s;
  s.name = in.text();
  for (double& v : s.translation_m) v = in.f64();
  for (double& v : s.rotation_xyzw) v = in.f64();
  s.first_stamp_s = in.f64();
  s.last_stamp_s = in.f64();
  return s;
}
bool is_valid(const Submap& s) {
  return is_finite(s.translation_m) && std::isfinite(s.first_stamp_s) && std::isfinite(s.last_stamp_s) &&
         std::all_of(s.rotation_xyzw.begin(), s.rotation_xyzw.end(),
                     [](double v) { return std::isfinite(v); });
}

/// A count whose entries take at least `least` bytes each of what is left.
Result<std::uint64_t> read_count(ByteReader& in, std::size_t least) {
  const std::uint64_t count = in.varint();
  if (!in.ok() || count > in.left() / least) return malformed("more entries than bytes", in);
  return count;
}

Status read_tables(ByteReader& in, std::uint16_t parts, MapInfo& info) {
  if (parts & kHasSubmaps) {
    MAPCODEC_ASSIGN(const std::uint64_t count, read_count(in, kLeastSubmap));
    for (std::uint64_t i = 0; i < count && in.ok(); ++i) info.submaps.push_back(read_submap(in));
  }
  if (parts & kHasSnapshots) {
    MAPCODEC_ASSIGN(const std::uint64_t count, read_count(in, kLeastSnapshot));
    for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
      std::string name = in.text();
      info.snapshots.push_back({std::move(name), in.varint()});
    }
  }
  if (parts & kHasExtras) {
    MAPCODEC_ASSIGN(const std::uint64_t count, read_count(in, kLeastExtra));
    for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
      std::string name = in.text();
      const ByteSpan value = in.sized();
      info.extras[std::move(name)].assign(value.begin(), value.end());
    }
  }
  return in.status("map metadata");
}

void write_tables(ByteWriter& out, const MapInfo& info) {
  if (!info.submaps.empty()) out.varint(info.submaps.size());
  for (const Submap& s : info.submaps) write_submap(out, s);
  if (!info.snapshots.empty()) out.varint(info.snapshots.size());
  for (const Snapshot& s : info.snapshots) {
    out.text(s.name);
    out.varint(s.revision);
  }
  if (!info.extras.empty()) out.varint(info.extras.size());
  for (const auto& [name, value] : info.extras) {
    out.text(name);
    out.sized(value);
  }
}

std::uint16_t parts_of(const MapInfo& info, bool placed_in_schema) {
  unsigned parts = 0;
  const auto e = to_array(info.achieved);
  for (std::size_t i = 0; i < 4; ++i) parts |= e[i] != 0 ? kHasErrors[i] : 0u;
  parts |= info.bounds.empty() ? 0u : kHasBounds;
  parts |= placed_in_schema ? kPlacedInSchema : 0u;
  parts |= info.flags != 0 ? kHasFlags : 0u;
  parts |= info.submaps.empty() ? 0u : kHasSubmaps;
  parts |= info.snapshots.empty() ? 0u : kHasSnapshots;
  parts |= info.extras.empty() ? 0u : kHasExtras;
  return static_cast<std::uint16_t>(parts);
}

Status read_placement(ByteReader& in, std::uint16_t parts, MapInfo& info) {
  if (parts & kPlacedInSchema) {
    ByteReader schema{ByteSpan(info.schema)};
    schema.raw(in.varint());
    for (double& v : info.origin) v = schema.f64();
    info.tile_size_m = schema.f64();
    if (!schema.ok()) return malformed("the schema ends before the tile size", in);
  } else {
    for (double& v : info.origin) v = read_short_double(in);
    info.tile_size_m = read_short_double(in);
  }
  MAPCODEC_TRY(in.status("map metadata"));
  if (!is_finite(info.origin)) return malformed("the origin is not finite", in);
  if (!(info.tile_size_m > 0) || !std::isfinite(info.tile_size_m))
    return malformed("the tile size is not positive", in);
  return {};
}

Status check_bounds(const MapInfo& info, double most_units) {
  for (std::size_t d = 0; d < 3 && !info.bounds.empty(); ++d) {
    for (const double v : {info.bounds.min[d], info.bounds.max[d]}) {
      if (!(std::abs(v - info.origin[d]) / unit_of(info) < most_units))
        return invalid("the bounds are too far from the origin");
      if (std::abs(info.origin[d]) / unit_of(info) > most_units)
        return invalid("the origin is too far away for the tile size");
    }
    if (info.bounds.min[d] > info.bounds.max[d]) return invalid("the bounds are inside out");
  }
  return {};
}

Status check_facts(const MapInfo& info, double most_units) {
  if (!is_finite(info.origin)) return invalid("the origin is not finite");
  if (!(info.tile_size_m > 0x1p-900) || !(info.tile_size_m < 0x1p900)) {
    return invalid("the tile size is not positive");
  }
  if (!is_valid(info.achieved)) return invalid("an achieved error is negative or not finite");
  for (const Submap& s : info.submaps) {
    if (!is_valid(s)) return invalid("a submap's pose is not finite");
  }
  return check_bounds(info, most_units);
}

}  // namespace

float round_up_to_float(double value) {
  const auto f = static_cast<float>(std::min<double>(value, std::numeric_limits<float>::max()));
  return static_cast<double>(f) < value ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

bool is_valid(const TileErrors& errors) {
  const auto e = to_array(errors);
  return std::all_of(e.begin(), e.end(), [](double v) { return v >= 0 && v <= kMaxError; });
}

Status check_info(const MapInfo& info) {
  return check_facts(info, kMaxBoundsUnits);
}

Bytes encode_metadata(const MapInfo& info, std::uint64_t tile_points) {
  const auto in_schema = find_placement(info);
  ByteWriter out;
  out.u16(parts_of(info, in_schema.has_value()));
  out.sized(info.schema);
  if (in_schema) {
    out.varint(*in_schema);
  } else {
    for (const double v : info.origin) write_short_double(out, v);
    write_short_double(out, info.tile_size_m);
  }
  out.varint(zigzag(static_cast<std::int64_t>(info.input_points - tile_points)));
  out.varint(info.input_bytes);
  out.varint(info.dropped_points);
  write_errors(out, info.achieved);
  if (!info.bounds.empty()) write_bounds(out, info);
  if (info.flags != 0) out.varint(info.flags);
  write_tables(out, info);
  return out.take();
}

Result<MapInfo> decode_metadata(ByteSpan bytes) {
  ByteReader in(bytes);
  const std::uint16_t parts = in.u16();
  if (parts > kKnown) return malformed("unknown parts", in);
  MapInfo info;
  const ByteSpan schema = in.sized();
  info.schema.assign(schema.begin(), schema.end());
  MAPCODEC_TRY(read_placement(in, parts, info));
  info.input_points = static_cast<std::uint64_t>(in.signed_varint());
  info.input_bytes = in.varint();
  info.dropped_points = in.varint();
  info.achieved = read_errors(in, parts);
  if (parts & kHasBounds) MAPCODEC_TRY(read_bounds(in, info));
  if (parts & kHasFlags) info.flags = in.varint();
  MAPCODEC_TRY(read_tables(in, parts, info));
  if (in.left() > 0) return malformed("bytes are left over", in);
  if (const Status fit = check_facts(info, 2 * kMaxBoundsUnits); !fit.ok()) {
    return malformed(fit.error().message.c_str(), in);
  }
  return info;
}

}  // namespace mapcodec
