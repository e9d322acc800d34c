// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/lossless_grid.hpp"

namespace mapcodec {
namespace {

/// 2^e as a double, -1022 <= e <= 1023.
double power_of_two(int e) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(e + 1023) << 52);
}

}  // namespace

std::uint64_t AxisGrid::magnitude_bits(double x) const {
  if (kind == Kind::f32) return std::bit_cast<std::uint32_t>(static_cast<float>(x)) & 0x7fffffffu;
  return std::bit_cast<std::uint64_t>(x) & ~(std::uint64_t{1} << 63);
}

double AxisGrid::from_magnitude(std::uint64_t bits, bool negative) const {
  if (kind == Kind::f32) {
    return std::bit_cast<float>(
        static_cast<std::uint32_t>((bits & 0x7fffffffu) | (negative ? 0x80000000u : 0u)));
  }
  return std::bit_cast<double>((bits & ~(std::uint64_t{1} << 63)) | (std::uint64_t{negative} << 63));
}

GridValue AxisGrid::split_lattice(double x) const {
  const std::int64_t k = lattice.nearest(x).value_or(0);
  GridValue v;
  v.rest_bits = rest_bits(0);
  v.cell = exponent >= 0 ? k >> exponent : k * (std::int64_t{1} << -exponent);
  v.rest = static_cast<std::uint64_t>(k) & ((std::uint64_t{1} << v.rest_bits) - 1);
  return v;
}

GridValue AxisGrid::split_float(double x) const {
  const double side = power_of_two(exponent), inverse = power_of_two(-exponent);
  const auto j = static_cast<std::int64_t>(std::abs(x) * inverse);
  const std::uint64_t bits = magnitude_bits(x);
  GridValue v;
  v.cell = std::signbit(x) ? -1 - j : j;
  v.rest_bits = rest_bits(v.cell);
  if (j > 0) {
    v.rest = bits - magnitude_bits(static_cast<double>(j) * side);
  } else {
    v.depth = most_depth() - static_cast<std::uint32_t>(bits >> mantissa());
    v.rest = bits & ((std::uint64_t{1} << mantissa()) - 1);
  }
  return v;
}

double AxisGrid::join(const GridValue& v) const {
  if (kind == Kind::lattice) {
    const std::int64_t k =
        exponent >= 0 ? static_cast<std::int64_t>((static_cast<std::uint64_t>(v.cell) << exponent) | v.rest)
                      : v.cell >> -exponent;
    return lattice.value(k);
  }
  const bool negative = v.cell < 0;
  const std::int64_t j = negative ? -1 - v.cell : v.cell;
  const std::uint64_t first = j > 0 ? magnitude_bits(static_cast<double>(j) * power_of_two(exponent))
                                    : std::uint64_t{most_depth() - v.depth} << mantissa();
  return from_magnitude(first + v.rest, negative);
}

void write_grid(ByteWriter& out, const AxisGrid& g) {
  const bool on_lattice = g.kind == AxisGrid::Kind::lattice;
  out.u8(on_lattice ? static_cast<std::uint8_t>(16 + static_cast<int>(g.lattice.kind))
                    : static_cast<std::uint8_t>(g.kind));
  if (on_lattice && g.lattice.kind != LatticeKind::fixed) out.u8(g.lattice.n);
  out.signed_varint(g.exponent);
}

Result<AxisGrid> read_grid(ByteReader& in, const CoordinateFormat& format, std::size_t axis) {
  AxisGrid g;
  const std::uint8_t kind = in.u8();
  if (kind > 1) {
    g.kind = AxisGrid::Kind::lattice;
    g.lattice.kind = static_cast<LatticeKind>(kind - 16);
    g.lattice.single = format.kind == CoordinateFormat::Kind::f32;
    g.lattice.scale = format.scale[axis];
    g.lattice.offset = format.offset[axis];
    if (g.lattice.kind != LatticeKind::fixed) g.lattice.n = in.u8();
  } else {
    g.kind = static_cast<AxisGrid::Kind>(kind);
  }
  const std::int64_t exponent = in.signed_varint();
  MAPCODEC_TRY(in.status("axis grid"));
  const bool known = kind < 2 || (kind >= 17 && kind <= 20);
  const std::uint8_t most_n = g.lattice.kind == LatticeKind::decimal  ? 9
                              : g.lattice.kind == LatticeKind::binary ? 30
                                                                      : 6;
  const int least = g.kind == AxisGrid::Kind::lattice ? -40 : AxisGrid::kLeast;
  if (!known || g.lattice.n > most_n || exponent < least || exponent > g.most()) {
    return make_error(ErrorCode::kMalformed, "unknown axis grid", in.offset());
  }
  g.exponent = static_cast<int>(exponent);
  return g;
}

}  // namespace mapcodec
