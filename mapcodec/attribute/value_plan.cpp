// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/value_plan.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kOnLattice = 1, kEscapes = 2, kPalette = 4, kCross = 8;  // bits 4, 5: predictor

void write_lattice(ByteWriter& out, const ValueLattice& l) {
  out.u8(static_cast<std::uint8_t>(l.kind));
  if (l.kind == LatticeKind::uniform) {
    out.f64(l.scale);
  } else {
    out.u8(l.n);
  }
}

Result<ValueLattice> read_lattice(ByteReader& in, ScalarType scalar) {
  ValueLattice l;
  l.single = scalar == ScalarType::f32;
  const std::uint8_t kind = in.u8();
  l.kind = static_cast<LatticeKind>(kind);
  if (l.kind == LatticeKind::uniform) {
    l.scale = in.f64();
  } else {
    l.n = in.u8();
  }
  MAPCODEC_TRY(in.status("value lattice"));
  const bool known = kind >= 1 && kind <= 5 && l.kind != LatticeKind::fixed;
  const std::uint8_t most = l.kind == LatticeKind::decimal ? 9 : l.kind == LatticeKind::binary ? 30 : 6;
  if (!known || l.n > most || !std::isfinite(l.scale) ||
      (scalar != ScalarType::f32 && scalar != ScalarType::f64)) {
    return make_error(ErrorCode::kMalformed, "unknown value lattice", in.offset());
  }
  return l;
}

Status read_palette(ByteReader& in, ComponentPlan& p) {
  const std::uint64_t count = in.varint() + 1;
  if (!in.ok() || count > kMostPalette || count > in.left() + 1) {
    return make_error(ErrorCode::kMalformed, "palette too large", in.offset());
  }
  std::uint64_t v = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t step = in.varint();
    if (!in.ok() || step > p.most - v)
      return make_error(ErrorCode::kMalformed, "broken palette", in.offset());
    p.palette.push_back(v += step);
  }
  return {};
}

std::uint8_t flags_of(const ComponentPlan& p) {
  std::uint8_t f = static_cast<std::uint8_t>(static_cast<std::uint8_t>(p.predictor) << 4);
  if (p.on_lattice) f |= kOnLattice;
  if (p.escapes) f |= kEscapes;
  if (!p.palette.empty()) f |= kPalette;
  if (p.cross != std::array<std::int8_t, 3>{}) f |= kCross;
  return f;
}

}  // namespace

void write_plan(ByteWriter& out, const ComponentPlan& p) {
  const std::uint8_t flags = flags_of(p);
  out.u8(flags);
  if (p.on_lattice) write_lattice(out, p.lattice);
  if (p.on_lattice) {
    out.signed_varint(static_cast<std::int64_t>(p.base - kLatticeKeyBias));
  } else {
    out.varint(p.base);
  }
  out.varint(p.divisor);
  out.varint(p.most);
  if (!p.palette.empty()) {
    out.varint(p.palette.size() - 1);
    std::uint64_t last = 0;
    for (const std::uint64_t v : p.palette) {
      out.varint(v - last);
      last = v;
    }
  }
  if ((flags & kCross) != 0) {
    for (const std::int8_t c : p.cross) out.u8(static_cast<std::uint8_t>(c));
  }
}

Result<ComponentPlan> read_plan(ByteReader& in, ScalarType scalar) {
  ComponentPlan p;
  const std::uint8_t flags = in.u8();
  p.on_lattice = (flags & kOnLattice) != 0;
  p.escapes = (flags & kEscapes) != 0;
  p.predictor = static_cast<Predictor>((flags >> 4) & 3);
  if ((flags >> 6) != 0 || (p.escapes && !p.on_lattice)) {
    return make_error(ErrorCode::kMalformed, "unknown channel flags", in.offset());
  }
  if (p.on_lattice) {
    MAPCODEC_ASSIGN(p.lattice, read_lattice(in, scalar));
  }
  p.base = p.on_lattice ? static_cast<std::uint64_t>(in.signed_varint()) + kLatticeKeyBias : in.varint();
  p.divisor = in.varint();
  p.most = in.varint();
  if ((flags & kPalette) != 0) MAPCODEC_TRY(read_palette(in, p));
  if ((flags & kCross) != 0) {
    for (std::int8_t& c : p.cross) c = static_cast<std::int8_t>(in.u8());
  }
  MAPCODEC_TRY(in.status("channel plan"));
  if (p.divisor == 0 || (p.predictor == Predictor::category && p.most_coded() > 255)) {
    return make_error(ErrorCode::kMalformed, "impossible channel plan", in.offset());
  }
  return p;
}

}  // namespace mapcodec
