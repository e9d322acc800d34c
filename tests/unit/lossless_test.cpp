// SPDX-License-Identifier: GPL-3.0-or-later
// Lossless geometry: every bit of every coordinate, whatever it is.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "mapcodec/codec/lossless_decoder.hpp"
#include "mapcodec/codec/lossless_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;
using Points = std::vector<Vec3>;

std::array<std::uint64_t, 3> bits_of(const Vec3& p) {
  return std::bit_cast<std::array<std::uint64_t, 3>>(p);
}

/// @return bits per point.
double round_trip(const Points& xyz, const CoordinateFormat& format) {
  const auto e = encode_lossless(xyz, format, {0, 0, 0}, Effort::standard);
  EXPECT_TRUE(e.ok());
  const auto d = decode_lossless(e->bytes, xyz.size(), format, {0, 0, 0}, {});
  EXPECT_TRUE(d.ok()) << d.error().to_string();
  if (!e || !d) return 0;
  EXPECT_EQ(d->voxels, e->voxels);
  EXPECT_EQ(e->order.size(), xyz.size());
  std::uint64_t last = 0;
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    EXPECT_EQ(bits_of(d->xyz[i]), bits_of(xyz[e->order[i]])) << i;
    EXPECT_GE(morton_encode(d->voxels[i]), last);
    last = morton_encode(d->voxels[i]);
  }
  return 8.0 * static_cast<double>(e->bytes.size()) /
         static_cast<double>(std::max<std::size_t>(1, xyz.size()));
}

CoordinateFormat format_of(Kind kind) {
  CoordinateFormat f;
  f.kind = kind;
  return f;
}

template <class F>
Points make_points(std::size_t count, F&& point) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-1, 1);
  Points p;
  for (std::size_t i = 0; i < count; ++i) p.push_back(point(u(random), u(random), u(random)));
  return p;
}

double f(double x) {
  return static_cast<float>(x);
}

TEST(Lossless, EdgesOfSize) {
  for (const Kind kind : {Kind::f32, Kind::f64, Kind::fixed}) {
    EXPECT_EQ(round_trip({}, format_of(kind)), 8);
    round_trip({{1, 2, 3}}, format_of(kind));
    round_trip(Points(1000, {0.5, -0.25, f(1.1)}), format_of(kind));
    round_trip({{0, 0, 0}, {-0.0, 0, 0}, {0, -0.0, -0.0}, {0, 0, 0}}, format_of(kind));
    round_trip(make_points(500,
                           [](double a, double, double) {
                             return Vec3{f(a), f(2 * a), f(-a)};
                           }),
               format_of(kind));
  }
}

TEST(Lossless, RandomFloatsOfEveryMagnitude) {
  std::mt19937_64 random(9);
  Points single, full;
  for (int i = 0; i < 3000; ++i) {
    Vec3 a{}, b{};
    for (std::size_t d = 0; d < 3; ++d) {
      a[d] = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
      b[d] = std::bit_cast<double>(random());
      if (std::isnan(a[d])) a[d] = NAN;
    }
    single.push_back(a);
    full.push_back(b);
  }
  round_trip(single, format_of(Kind::f32));
  round_trip(full, format_of(Kind::f64));
  round_trip(full, format_of(Kind::f32));
  round_trip(full, format_of(Kind::fixed));
}

TEST(Lossless, ExtremesAndSubnormals) {
  using L = std::numeric_limits<float>;
  using D = std::numeric_limits<double>;
  round_trip({{L::max(), L::lowest(), L::min()}, {L::denorm_min(), -L::denorm_min(), 0}, {1, -1, -0.0}},
             format_of(Kind::f32));
  round_trip({{D::max(), D::lowest(), D::min()}, {D::denorm_min(), -D::denorm_min(), 0}, {1, -1, -0.0}},
             format_of(Kind::f64));
}

TEST(Lossless, NoiseCostsItsBitsAndNoMore) {
  const Points p = make_points(20000, [](double a, double b, double c) {
    return Vec3{f(20 + 5 * a), f(7 + 5 * b), f(2 + 0.01 * c)};
  });
  EXPECT_LT(round_trip(p, format_of(Kind::f32)), 3 * 24.0);
}

TEST(Lossless, DecimalsOfATextFileCostLikeIntegers) {
  const auto text = [](double a, double b, double c) {
    return Vec3{f(std::round(8000 * a) / 1000), f(std::round(8000 * b) / 1000),
                f(std::round(100 * c) / 1000)};
  };
  EXPECT_LT(round_trip(make_points(20000, text), format_of(Kind::f32)), 26);
  const auto utm = [](double a, double b, double c) {
    return Vec3{std::round(515368602 + 8000 * a) / 1000, std::round(4918340364 + 8000 * b) / 1000,
                std::round(100 * c) / 1000};
  };
  EXPECT_LT(round_trip(make_points(20000, utm), format_of(Kind::f64)), 26);
}

TEST(Lossless, FixedPointOfLas) {
  CoordinateFormat format = format_of(Kind::fixed);
  format.scale = {0.01, 0.001, 0.0025};
  format.offset = {500000.003, 4e6, -17.1};
  const auto las = [&](double a, double b, double c) {
    return Vec3{std::round(2e9 * a) * format.scale[0] + format.offset[0],
                std::round(1000 * b) * format.scale[1] + format.offset[1],
                std::round(1000 * c) * format.scale[2] + format.offset[2]};
  };
  EXPECT_LT(round_trip(make_points(5000, las), format), 64);
}

TEST(Lossless, MillimetresTimesAFloatUnit) {
  const auto depth = [](double a, double b, double c) {
    const float z = 0.001f * static_cast<float>(std::lround(2000 + 500 * c));
    return Vec3{f(a), f(b), double{z}};
  };
  EXPECT_LT(round_trip(make_points(5000, depth), format_of(Kind::f32)), 70);
}

TEST(Lossless, OrganisedFramesKeepTheirNans) {
  const double payload = std::bit_cast<double>(std::uint64_t{0x7ff8'0000'2000'0000});
  Points p(100000, {NAN, NAN, NAN});
  for (std::size_t i = 0; i < 100; ++i) p[37 * i] = {f(0.01 * static_cast<double>(i)), 1, 2};
  p[5] = {1, payload, -std::numeric_limits<double>::infinity()};
  EXPECT_LT(round_trip(p, format_of(Kind::f32)), 0.1);
}

TEST(Lossless, SameBytesTwice) {
  const Points p = make_points(3000, [](double a, double b, double c) { return Vec3{f(a), f(b), f(c)}; });
  const auto a = encode_lossless(p, {}, {0, 0, 0}, Effort::standard),
             b = encode_lossless(p, {}, {0, 0, 0}, Effort::standard);
  EXPECT_EQ(a->bytes, b->bytes);
}

void damage(const Points& p, const CoordinateFormat& format) {
  const Bytes whole = encode_lossless(p, format, {0, 0, 0}, Effort::standard)->bytes;
  const auto check = [&](const Bytes& b) {
    const auto d = decode_lossless(b, p.size(), format, {0, 0, 0}, {});
    if (!d) return;
    EXPECT_EQ(d->xyz.size(), p.size());
    EXPECT_EQ(d->voxels.size(), p.size());
  };
  for (std::size_t n = 0; n < whole.size(); ++n) {
    check(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)));
    for (const int flip : {0x01, 0x80, 0xff}) {
      Bytes b = whole;
      b[n] = static_cast<std::uint8_t>(b[n] ^ flip);
      check(b);
    }
  }
}

TEST(Lossless, DamagedBytesNeverCrash) {
  Points p = make_points(120, [](double a, double b, double c) { return Vec3{f(a), f(0.001 * b), f(c)}; });
  p.insert(p.end(), {{NAN, 1, 2}, {0, 0, 0}, {-0.0, 0, 0}});
  damage(p, format_of(Kind::f32));
  damage(make_points(100,
                     [](double a, double b, double c) {
                       return Vec3{std::round(99 * a) / 10, std::round(99 * b) / 10, c};
                     }),
         format_of(Kind::f64));
}

TEST(Lossless, LimitsAreKept) {
  DecodeLimits small;
  small.max_points = 10;
  const Points p(11, {1, 2, 3});
  const auto d =
      decode_lossless(encode_lossless(p, {}, {0, 0, 0}, Effort::standard)->bytes, 11, {}, {0, 0, 0}, small);
  ASSERT_FALSE(d.ok());
  EXPECT_EQ(d.error().code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace mapcodec
