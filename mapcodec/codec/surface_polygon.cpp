// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_polygon.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace mapcodec::surface {
namespace {

std::int64_t value(std::int64_t c, std::int64_t gu, std::int64_t gv, const Vertex& p) {
  return c + ((gu * p.u + gv * p.v) >> kVertexBits);
}

Vertex between(const Vertex& p, const Vertex& q, std::int64_t fp, std::int64_t fq) {
  return {static_cast<std::int32_t>(p.u + (std::int64_t{q.u} - p.u) * fp / (fp - fq)),
          static_cast<std::int32_t>(p.v + (std::int64_t{q.v} - p.v) * fp / (fp - fq))};
}

/// Length of a step along one side of the polygon, its slope included (within 7 %).
std::int64_t stretch(std::int64_t flat, std::int64_t rise) {
  const std::int64_t big = std::max(flat, std::abs(rise)), small = std::min(flat, std::abs(rise));
  return big + small * 3 / 8;
}

struct Weights {
  std::int64_t u, v;
};

std::int64_t density_at(const Tilt& tilt, std::int64_t u, std::int64_t v) {
  constexpr std::int64_t kMiddle = std::int64_t{256} << kVertexBits, kLeast = kMiddle / 8;
  return std::max(kMiddle + tilt.u * u + tilt.v * v, kLeast);
}

/// The share (of 65536) of an area that the lower of two parts of the points take, where the density goes
/// from r0 to r1.
std::int64_t tilted_share(std::uint32_t lower, std::uint32_t count, std::int64_t r0, std::int64_t r1) {
  const std::int64_t even = (std::int64_t{lower} << 16) / count;
  return even + (even * (65536 - even) >> 16) * (r1 - r0) / (r1 + r0);
}

struct Rectangle {
  std::int32_t u0, v0, u1, v1;
};

/// Where `lower` of `count` points end.
std::int32_t cut_rectangle(const Rectangle& r, bool is_u, std::uint32_t lower, std::uint32_t count,
                           const Tilt& tilt) {
  const std::int32_t x0 = is_u ? r.u0 : r.v0, x1 = is_u ? r.u1 : r.v1;
  const std::int64_t length = std::int64_t{x1} - x0;
  if (!tilt.any()) return static_cast<std::int32_t>(x0 + length * lower / count);
  const std::int64_t y = is_u ? (r.v0 + r.v1) >> 1 : (r.u0 + r.u1) >> 1;
  const std::int64_t r0 = is_u ? density_at(tilt, x0, y) : density_at(tilt, y, x0);
  const std::int64_t r1 = is_u ? density_at(tilt, x1, y) : density_at(tilt, y, x1);
  return static_cast<std::int32_t>(x0 + (length * tilted_share(lower, count, r0, r1) >> 16));
}

void spread_rectangle(const Rectangle& r, const Weights& w, std::uint32_t count, const Tilt& tilt,
                      std::vector<Vertex>& out) {
  if (count == 1) {
    out.push_back({(r.u0 + r.u1) >> 1, (r.v0 + r.v1) >> 1});
    return;
  }
  const std::uint32_t lower = count / 2;
  const bool is_u = w.u * (r.u1 - r.u0) >= w.v * (r.v1 - r.v0);
  const std::int32_t at = cut_rectangle(r, is_u, lower, count, tilt);
  Rectangle left = r, right = r;
  (is_u ? left.u1 : left.v1) = at;
  (is_u ? right.u0 : right.v0) = at;
  spread_rectangle(left, w, lower, tilt, out);
  spread_rectangle(right, w, count - lower, tilt, out);
}

Vertex centroid(const Polygon& p) {
  const Vertex& o = p.at[0];
  std::int64_t area = 0, su = 0, sv = 0;
  for (int i = 1; i + 1 < p.size; ++i) {
    const std::int64_t au = p.at[i].u - o.u, av = p.at[i].v - o.v;
    const std::int64_t bu = p.at[i + 1].u - o.u, bv = p.at[i + 1].v - o.v;
    const std::int64_t twice = au * bv - av * bu;
    area += twice;
    su += (twice >> 4) * (au + bu);
    sv += (twice >> 4) * (av + bv);
  }
  area = (area >> 4) * 3;
  if (area <= 0) {  // a sliver: the middle of its corners
    std::int64_t u = 0, v = 0;
    for (int i = 0; i < p.size; ++i) {
      u += p.at[i].u;
      v += p.at[i].v;
    }
    return {static_cast<std::int32_t>(u / p.size), static_cast<std::int32_t>(v / p.size)};
  }
  return {static_cast<std::int32_t>(o.u + su / area), static_cast<std::int32_t>(o.v + sv / area)};
}

std::int32_t along(const Vertex& p, bool is_u) {
  return is_u ? p.u : p.v;
}

/// Width of the polygon across the line at `x`.
std::int64_t width_at(const Polygon& p, bool is_u, std::int64_t x) {
  std::int64_t least = kHalf * 4, most = -kHalf * 4;
  for (int i = 0; i < p.size; ++i) {
    const Vertex& a = p.at[i];
    const Vertex& b = p.at[i + 1 == p.size ? 0 : i + 1];
    const std::int64_t x0 = along(a, is_u), x1 = along(b, is_u), y0 = along(a, !is_u), y1 = along(b, !is_u);
    if (x == x0) {
      least = std::min(least, y0);
      most = std::max(most, y0);
    } else if ((x0 < x && x < x1) || (x1 < x && x < x0)) {
      const std::int64_t y = y0 + (y1 - y0) * (x - x0) / (x1 - x0);
      least = std::min(least, y);
      most = std::max(most, y);
    }
  }
  return most > least ? most - least : 0;
}

/// The least x in [0, length] up to which a trapezium of widths w0 to w1 has `goal` or more of twice the
/// area.
std::int64_t place_in_slab(std::int64_t length, std::int64_t w0, std::int64_t w1, std::int64_t goal) {
  // Twice the area up to x, times the length: x (2 w0 length + (w1 - w0) x), which grows with x. The root in
  // floating point is only a guess: the integers decide.
  const auto enough = [&](std::int64_t x) { return x * (2 * w0 * length + (w1 - w0) * x) >= goal * length; };
  const double b = double(w0) * double(length), c = double(goal) * double(length);
  const double root = b + std::sqrt(std::max(0.0, b * b + double(w1 - w0) * c));
  std::int64_t x = root > 0 ? static_cast<std::int64_t>(std::min(c / root, double(length))) : 0;
  while (x < length && !enough(x)) ++x;
  while (x > 0 && enough(x - 1)) --x;
  return x;
}

/// Twice the area that the lower of two parts of the points take; the polygon reaches from x0 to x1.
std::int64_t lower_area(const Polygon& p, bool is_u, std::uint32_t lower, std::uint32_t count,
                        const Tilt& tilt, std::int64_t x0, std::int64_t x1) {
  const std::int64_t total = twice_area(p);
  if (!tilt.any()) return total / count * lower + total % count * lower / count;
  std::int64_t y = 0;
  for (int i = 0; i < p.size; ++i) y += along(p.at[i], !is_u);
  y /= p.size;
  const std::int64_t r0 = is_u ? density_at(tilt, x0, y) : density_at(tilt, y, x0);
  const std::int64_t r1 = is_u ? density_at(tilt, x1, y) : density_at(tilt, y, x1);
  return total * tilted_share(lower, count, r0, r1) >> 16;
}

/// The coordinate below which `lower` of `count` points lie.
std::int32_t cut_position(const Polygon& p, bool is_u, std::uint32_t lower, std::uint32_t count,
                          const Tilt& tilt) {
  std::array<std::int32_t, 12> stops;
  for (int i = 0; i < p.size; ++i) {
    int j = i;
    for (; j > 0 && stops[j - 1] > along(p.at[i], is_u); --j) stops[j] = stops[j - 1];
    stops[j] = along(p.at[i], is_u);
  }
  std::int64_t goal = lower_area(p, is_u, lower, count, tilt, stops[0], stops[p.size - 1]);
  std::int64_t w0 = width_at(p, is_u, stops[0]);
  for (int i = 1; i < p.size; ++i) {
    const std::int64_t length = std::int64_t{stops[i]} - stops[i - 1];
    if (length == 0) continue;
    const std::int64_t w1 = width_at(p, is_u, stops[i]);
    const std::int64_t slab = length * (w0 + w1);
    if (slab < goal) {
      goal -= slab;
      w0 = w1;
      continue;
    }
    return static_cast<std::int32_t>(stops[i - 1] + place_in_slab(length, w0, w1, goal));
  }
  return stops[p.size - 1];
}

/// Keeps the part with coordinate <= at (lower) or >= at.
Polygon part(const Polygon& p, bool is_u, std::int32_t at, bool lower) {
  Polygon r;
  const int sign = lower ? 1 : -1;
  for (int i = 0; i < p.size; ++i) {
    const Vertex& a = p.at[i];
    const Vertex& b = p.at[i + 1 == p.size ? 0 : i + 1];
    const std::int64_t fa = std::int64_t{sign} * (along(a, is_u) - at);
    const std::int64_t fb = std::int64_t{sign} * (along(b, is_u) - at);
    if (fa <= 0 && r.size < 12) r.at[static_cast<std::size_t>(r.size++)] = a;
    if (((fa < 0 && fb > 0) || (fa > 0 && fb < 0)) && r.size < 12) {
      Vertex x = between(a, b, fa, fb);
      (is_u ? x.u : x.v) = at;
      r.at[static_cast<std::size_t>(r.size++)] = x;
    }
  }
  return r;
}

void spread_polygon(const Polygon& p, const Weights& w, std::uint32_t count, const Tilt& tilt,
                    std::vector<Vertex>& out) {
  if (count == 1) {
    out.push_back(centroid(p));
    return;
  }
  std::int32_t u0 = p.at[0].u, u1 = u0, v0 = p.at[0].v, v1 = v0;
  for (int i = 1; i < p.size; ++i) {
    u0 = std::min(u0, p.at[i].u);
    u1 = std::max(u1, p.at[i].u);
    v0 = std::min(v0, p.at[i].v);
    v1 = std::max(v1, p.at[i].v);
  }
  const bool is_u = w.u * (u1 - u0) >= w.v * (v1 - v0);
  const std::uint32_t lower = count / 2;
  const std::int32_t at = cut_position(p, is_u, lower, count, tilt);
  Polygon left = part(p, is_u, at, true), right = part(p, is_u, at, false);
  if (left.size < 3) left = p;
  if (right.size < 3) right = p;
  spread_polygon(left, w, lower, tilt, out);
  spread_polygon(right, w, count - lower, tilt, out);
}

// cos and sin of sixteenths of a turn in 1/4096.
constexpr std::array<std::int32_t, 16> kCos{4096,  3784,  2896,  1567,  0, -1567, -2896, -3784,
                                            -4096, -3784, -2896, -1567, 0, 1567,  2896,  3784};

}  // namespace

void clip(Polygon& polygon, std::int64_t c, std::int64_t gu, std::int64_t gv) {
  std::array<std::int64_t, 12> f;
  bool cuts = false;
  for (int i = 0; i < polygon.size; ++i) {
    f[i] = value(c, gu, gv, polygon.at[i]);
    cuts = cuts || f[i] > 0;
  }
  polygon.rectangle = false;
  if (!cuts) return;
  Polygon r;
  for (int i = 0; i < polygon.size; ++i) {
    const int next = i + 1 == polygon.size ? 0 : i + 1;
    const std::int64_t fa = f[i], fb = f[next];
    if (fa <= 0 && r.size < 12) r.at[static_cast<std::size_t>(r.size++)] = polygon.at[i];
    if (((fa < 0 && fb > 0) || (fa > 0 && fb < 0)) && r.size < 12) {
      r.at[static_cast<std::size_t>(r.size++)] = between(polygon.at[i], polygon.at[next], fa, fb);
    }
  }
  polygon = r;
}

Polygon rectangle_of(const Room& room, const CellShape& shape, unsigned axis) {
  const auto vertex = [&](std::int32_t units, unsigned d) {
    return static_cast<std::int32_t>((std::int64_t{units} * (2 * kHalf) >> shape[d]) - kHalf);
  };
  const unsigned u = (axis + 1) % 3, v = (axis + 2) % 3;
  const std::int32_t u0 = vertex(room.begin[u], u), u1 = vertex(room.end[u], u);
  const std::int32_t v0 = vertex(room.begin[v], v), v1 = vertex(room.end[v], v);
  Polygon p;
  p.size = 4;
  p.at[0] = {u0, v0};
  p.at[1] = {u1, v0};
  p.at[2] = {u1, v1};
  p.at[3] = {u0, v1};
  p.rectangle = true;
  return p;
}

Polygon polygon_of(const Plane& plane, const CellShape& shape, const Room& room) {
  const unsigned k = plane.axis;
  const std::int64_t half = half_side(shape[k]);
  const std::int64_t top = std::int64_t{room.end[k]} * (1 << kHeightBits) - half;
  const std::int64_t bottom = half - std::int64_t{room.begin[k]} * (1 << kHeightBits);
  const std::int64_t reach = std::abs(std::int64_t{plane.a}) + std::abs(std::int64_t{plane.b});
  if (std::abs(std::int64_t{plane.h}) > half + reach) return {};
  Polygon p = rectangle_of(room, shape, k);
  if (plane.h + reach > top) clip(p, plane.h - top, plane.a, plane.b);
  if (-plane.h + reach > bottom) clip(p, -plane.h - bottom, -std::int64_t{plane.a}, -std::int64_t{plane.b});
  return p;
}

void cut(Polygon& polygon, const Wedge& wedge) {
  const std::int64_t c = kCos[wedge.angle & 15], s = kCos[(wedge.angle + 12) & 15];
  const std::int64_t most = (std::abs(c) + std::abs(s)) * kHalf;
  clip(polygon, -(most * (wedge.offset - 15) / 16), c << kVertexBits, s << kVertexBits);
}

std::int64_t twice_area(const Polygon& p) {
  std::int64_t sum = 0;
  for (int i = 0; i < p.size; ++i) {
    const Vertex& a = p.at[i];
    const Vertex& b = p.at[i + 1 == p.size ? 0 : i + 1];
    sum += std::int64_t{a.u} * b.v - std::int64_t{a.v} * b.u;
  }
  return sum;
}

int lower_share(const Plane& plane, const CellShape& shape, const Room& room, unsigned split_axis) {
  return lower_share(polygon_of(plane, shape, room), plane, shape, room, split_axis);
}

int lower_share(const Polygon& polygon, const Plane& plane, const CellShape& shape, const Room& room,
                unsigned split_axis) {
  Polygon p = polygon;
  const std::int64_t all = twice_area(p);
  if (p.size < 3 || all < 256) return -1;
  if (split_axis == plane.axis) {
    clip(p, plane.h, plane.a, plane.b);
  } else if (p.rectangle && room.end[split_axis] == 1 << shape[split_axis]) {
    return 128;
  } else if (split_axis == (plane.axis + 1u) % 3) {
    clip(p, 0, kHalf, 0);
  } else {
    clip(p, 0, 0, kHalf);
  }
  const std::int64_t share = twice_area(p) / (all >> 8);
  return static_cast<int>(share < 0 ? 0 : (share > 256 ? 256 : share));
}

void spread(const Polygon& polygon, const Plane& plane, const CellShape& shape, std::uint32_t count,
            const Tilt& tilt, std::vector<Vertex>& out) {
  if (count == 0) return;
  if (polygon.size < 3) {
    out.insert(out.end(), count, Vertex{0, 0});
    return;
  }
  const Weights w{stretch(half_side(shape[(plane.axis + 1u) % 3]), plane.a),
                  stretch(half_side(shape[(plane.axis + 2u) % 3]), plane.b)};
  if (polygon.rectangle) {
    const Vertex &low = polygon.at[0], &high = polygon.at[2];
    spread_rectangle({low.u, low.v, high.u, high.v}, w, count, tilt, out);
  } else {
    spread_polygon(polygon, w, count, tilt, out);
  }
}

}  // namespace mapcodec::surface
