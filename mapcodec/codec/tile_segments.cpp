// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/tile_segments.hpp"

#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/codec/tile_sections.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kHasBox = 1, kHasSphere = 2, kHasValues = 4, kInverse = 8, kMoved = 16;

bool begins_with(ByteSpan payload, CodecId id) {
  return !payload.empty() && payload[0] == static_cast<std::uint8_t>(id);
}

std::uint8_t conditions_of(const Erasure& e) {
  return static_cast<std::uint8_t>((e.box ? kHasBox : 0) | (e.sphere ? kHasSphere : 0) |
                                   (e.values ? kHasValues : 0) | (e.inverse ? kInverse : 0) |
                                   (e.motion ? kMoved : 0));
}

Vec3 read_vec3(ByteReader& in) {
  Vec3 v;
  for (double& x : v) x = in.f64();
  return v;
}

void write_vec3(ByteWriter& out, const Vec3& v) {
  for (const double x : v) out.f64(x);
}

bool has_nan(const Erasure& e) {
  double sum = 0;  // infinities are limits like others, so their difference must not come in
  const auto look = [&sum](double x) { sum += std::isnan(x) ? x : 0; };
  for (std::size_t d = 0; d < 3; ++d) {
    if (e.box) look(e.box->min[d]), look(e.box->max[d]);
    if (e.sphere) look(e.sphere->centre[d]);
  }
  if (e.sphere) look(e.sphere->radius_m);
  for (const double x : e.motion.value_or(std::array<double, 12>{})) look(x);
  if (e.values) look(e.values->least), look(e.values->most);
  return std::isnan(sum);
}

double value_at(const Channel& channel, std::size_t i) {
  return visit_scalar(channel.info.scalar,
                      [&](auto type) { return static_cast<double>(channel.get<decltype(type)>(i)); });
}

bool in_sphere(const Vec3& p, const Erasure::Sphere& s) {
  double d2 = 0;
  for (std::size_t d = 0; d < 3; ++d) d2 += (p[d] - s.centre[d]) * (p[d] - s.centre[d]);
  return d2 <= s.radius_m * s.radius_m;
}

Vec3 moved(const std::array<double, 12>& m, const Vec3& p) {
  Vec3 r;
  for (std::size_t d = 0; d < 3; ++d)
    r[d] = m[3 * d] * p[0] + m[3 * d + 1] * p[1] + m[3 * d + 2] * p[2] + m[9 + d];
  return r;
}

bool holds(const Erasure& e, const Vec3& point, const Channel* values, std::size_t i) {
  const Vec3 p = e.motion ? moved(*e.motion, point) : point;
  if (e.box && !e.box->contains(p)) return false;
  if (e.sphere && !in_sphere(p, *e.sphere)) return false;
  if (!e.values) return true;
  const double v = value_at(*values, i);
  return v >= e.values->least && v <= e.values->most;
}

}  // namespace

Bytes write_erasure(const Erasure& e) {
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(CodecId::erasure));
  out.u8(conditions_of(e));
  for (std::size_t i = 0; e.motion && i < 12; ++i) out.f64((*e.motion)[i]);
  if (e.box) write_vec3(out, e.box->min), write_vec3(out, e.box->max);
  if (e.sphere) write_vec3(out, e.sphere->centre), out.f64(e.sphere->radius_m);
  if (e.values) {
    out.text(e.values->channel);
    out.f64(e.values->least);
    out.f64(e.values->most);
  }
  return out.take();
}

Result<Erasure> read_erasure(ByteSpan payload) {
  if (!is_erasure(payload)) return make_error(ErrorCode::kMalformed, "not an erasure", 0);
  ByteReader in(payload.subspan(1));
  const std::uint8_t bits = in.u8();
  Erasure e;
  e.inverse = (bits & kInverse) != 0;
  if ((bits & kMoved) != 0) {
    e.motion.emplace();
    for (double& x : *e.motion) x = in.f64();
  }
  if ((bits & kHasBox) != 0) {
    const Vec3 low = read_vec3(in);
    e.box = Box{low, read_vec3(in)};
  }
  if ((bits & kHasSphere) != 0) {
    const Vec3 centre = read_vec3(in);
    e.sphere = Erasure::Sphere{centre, in.f64()};
  }
  if ((bits & kHasValues) != 0) {
    std::string name = in.text();
    const double least = in.f64();
    e.values = Erasure::Values{std::move(name), least, in.f64()};
  }
  MAPCODEC_TRY(in.status("erasure"));
  const bool known = (bits & ~(kHasBox | kHasSphere | kHasValues | kInverse | kMoved)) == 0;
  if (!known || (bits & (kHasBox | kHasSphere | kHasValues)) == 0 || in.left() != 0 || has_nan(e))
    return make_error(ErrorCode::kMalformed, "erasure without or with unknown conditions", 1);
  return e;
}

Status erase_points(PointCloud& cloud, const Erasure& e) {
  const Channel* values = e.values ? cloud.find(e.values->channel) : nullptr;
  if (e.values && (values == nullptr || values->info.components != 1))
    return make_error(ErrorCode::kMalformed,
                      "erasure by '" + e.values->channel + "', which the tile does not have");
  std::vector<std::uint32_t> keep;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (holds(e, cloud.xyz[i], values, i) == e.inverse) keep.push_back(static_cast<std::uint32_t>(i));
  }
  if (keep.size() != cloud.size()) cloud = cloud.gather(keep);
  return {};
}

bool is_erased(const Erasure& e, const Vec3& p) {
  return !e.values && holds(e, p, nullptr, 0) != e.inverse;
}

bool is_joined(ByteSpan payload) {
  return begins_with(payload, CodecId::joined);
}
bool is_erasure(ByteSpan payload) {
  return begins_with(payload, CodecId::erasure);
}

Bytes join_segments(std::span<const Bytes> segments) {
  std::vector<ByteSpan> all;
  for (const Bytes& s : segments) {
    const auto parts = split_segments(s);
    if (parts.ok()) {
      all.insert(all.end(), parts->begin(), parts->end());
    } else {
      all.emplace_back(s);  // damaged: the decoder shall say so
    }
  }
  if (all.size() == 1) return Bytes(all[0].begin(), all[0].end());
  ByteWriter out;
  out.u8(static_cast<std::uint8_t>(CodecId::joined));
  out.varint(all.size());
  for (const ByteSpan s : all) out.sized(s);
  return out.take();
}

Result<std::vector<ByteSpan>> split_segments(ByteSpan payload) {
  if (!is_joined(payload)) return std::vector<ByteSpan>{payload};
  ByteReader in(payload.subspan(1));
  const std::uint64_t count = in.varint();
  std::vector<ByteSpan> parts;
  for (std::uint64_t i = 0; i < count && in.ok(); ++i) {
    parts.push_back(in.sized());
    if (is_joined(parts.back())) return make_error(ErrorCode::kMalformed, "segments within segments");
  }
  MAPCODEC_TRY(in.status("segments"));
  if (parts.empty() || in.left() != 0)
    return make_error(ErrorCode::kMalformed, "segments do not fill their payload");
  return parts;
}

void mark_pending(Bytes& payload) {
  if (payload.size() > 1) payload[1] |= kTileFlagPending;
}

bool is_pending(ByteSpan payload) {
  return payload.size() > 1 && !is_joined(payload) && !is_erasure(payload) &&
         (payload[1] & kTileFlagPending) != 0;
}

Result<PointCloud> decode_segments(ByteSpan payload, PointCloud empty, const DecodeLimits& limits,
                                   const SegmentDecoder& decode) {
  MAPCODEC_ASSIGN(const std::vector<ByteSpan> segments, split_segments(payload));
  DecodeLimits left = limits;
  std::optional<PointCloud> all;
  for (const ByteSpan segment : segments) {
    if (is_erasure(segment)) {
      MAPCODEC_ASSIGN(const Erasure e, read_erasure(segment));
      const bool blind = e.values && all && all->channels.empty();  // coarse points: nothing to ask
      if (all && !blind) MAPCODEC_TRY(erase_points(*all, e));
      continue;
    }
    MAPCODEC_ASSIGN(PointCloud cloud, decode(segment, left));
    left.max_points -= cloud.size();
    if (all) {
      all->append(cloud);
    } else {
      all = std::move(cloud);
    }
  }
  return all ? std::move(*all) : std::move(empty);
}

}  // namespace mapcodec
