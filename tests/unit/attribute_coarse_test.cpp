// SPDX-License-Identifier: GPL-3.0-or-later
// Coarse colours: few symbols, each weighed.
#include <gtest/gtest.h>

#include <cmath>

#include "mapcodec/attribute/coarse_color.hpp"
#include "mapcodec/attribute/color_walk.hpp"
#include "tests/unit/attribute_fixtures.hpp"

namespace mapcodec {
namespace {

using test::wavy_voxels;

ColorAims aims_of(const Channel& c, ColorScale scale) {
  ColorAims aims;
  for (std::size_t i = 0; i < c.size(); ++i) {
    const auto v = load_rgb(c, i);
    const float unit = scale == ColorScale::sixteen ? 1.0f / 257 : 1.0f;
    aims.rgb.push_back(
        {static_cast<float>(v[0]) * unit, static_cast<float>(v[1]) * unit, static_cast<float>(v[2]) * unit});
    aims.weights.push_back(0.2f);
  }
  return aims;
}

CoarseColors code(const Channel& c, const std::vector<VoxelCoord>& voxels, double step, std::uint8_t trust) {
  CoarseColorEncoder encoder(voxels, c.info, ColorScale::eight);
  return encoder.encode(aims_of(c, ColorScale::eight), static_cast<std::uint32_t>(16 * step), 0.05 * step,
                        trust);
}

double mean_distance(const Channel& a, const Channel& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const auto x = load_rgb(a, i), y = load_rgb(b, i);
    sum += std::hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2]);
  }
  return sum / static_cast<double>(a.size());
}

ChannelSchema bounded(const Channel& c) {
  return test::schema_of(c, ChannelKept::bounded, 10);
}

TEST(CoarseColor, DecodesToWhatTheEncoderSaw) {
  for (const std::size_t count : {1, 2, 9, 300, 20000}) {
    for (const std::uint32_t side : {1u, 8u, 1024u, 2097151u}) {
      const auto voxels = wavy_voxels(count, side);
      const Channel c = test::smooth_rgb(voxels, 60);
      for (const std::uint8_t trust : {std::uint8_t{0}, std::uint8_t{12}, kMostTrust}) {
        for (const double step : {0.1, 8.0, 60.0}) {
          const CoarseColors e = code(c, voxels, step, trust);
          const auto d = decode_channel(e.bytes, bounded(c), voxels, {});
          ASSERT_TRUE(d.ok()) << count << ' ' << side << ": " << d.error().message;
          ASSERT_EQ(d->data, e.decoded.data) << count << ' ' << side << ' ' << int{trust} << ' ' << step;
          ASSERT_GE(e.runs.size(), 2u);
          EXPECT_EQ(e.runs.front(), 0u);
          EXPECT_EQ(e.runs.back(), count);
          EXPECT_LE(e.trust, kMostTrust);
        }
      }
    }
  }
}

/// Vertical stripes of two colours, and a slope of brightness in each.
Channel stripes(const std::vector<VoxelCoord>& voxels) {
  return test::make_channel<std::uint8_t>("rgb", ScalarType::u8, 3, voxels,
                                          [](const VoxelCoord& v, std::size_t c, std::uint32_t r) {
                                            const bool light = (v[0] / 180) % 2 == 0;
                                            return (light ? 150 : 60) + v[1] / 32 + 10 * c + r % 24;
                                          });
}

TEST(CoarseColor, NeedsFewerBytesThanFineSettingsForTheSameError) {
  const auto voxels = wavy_voxels(40000, 1024);
  for (const Channel& c : {test::smooth_rgb(voxels, 40), stripes(voxels)}) {
    std::uint8_t trust = CoarseColorEncoder::kUsualTrust;
    CoarseColors e;
    for (int i = 0; i < 2; ++i, trust = e.trust) e = code(c, voxels, 70, trust);
    const double error = mean_distance(c, e.decoded);
    const auto fine =
        encode_channel(test::schema_of(c, ChannelKept::bounded, error), c, voxels, Effort::standard);
    ASSERT_TRUE(fine.ok());
    EXPECT_LT(static_cast<double>(e.bytes.size()), 0.9 * static_cast<double>(fine->bytes.size())) << error;
  }
}

TEST(CoarseColor, SlopesAreTrustedMoreThanNoise) {
  const auto voxels = wavy_voxels(20000, 1024);
  const auto noise = test::make_channel<std::uint8_t>(
      "rgb", ScalarType::u8, 3, voxels,
      [](const VoxelCoord&, std::size_t, std::uint32_t r) { return r % 256; });
  const auto trust = [&](const Channel& c) {
    return int{code(c, voxels, 30, CoarseColorEncoder::kUsualTrust).trust};
  };
  EXPECT_GT(trust(test::smooth_rgb(voxels, 0)), trust(noise) + 3);
}

TEST(CoarseColor, DamageGivesAnErrorOrAChannelOfTheRightSize) {
  const auto voxels = wavy_voxels(150, 64);
  const Channel c = test::smooth_rgb(voxels, 120);
  const Bytes whole = code(c, voxels, 10, 12).bytes;
  const auto check = [&](const Bytes& b) {
    const auto d = decode_channel(b, bounded(c), voxels, {});
    if (d) {
      EXPECT_EQ(d->data.size(), c.data.size());
    }
  };
  for (std::size_t n = 0; n < whole.size(); ++n) {
    check(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)));
    for (int bit = 0; bit < 8; ++bit) {
      Bytes b = whole;
      b[n] = static_cast<std::uint8_t>(b[n] ^ (1 << bit));
      check(b);
    }
  }
}

TEST(CoarseColor, HeadsOfOtherVersionsAreRefused) {
  const auto voxels = wavy_voxels(150, 64);
  const Channel c = test::smooth_rgb(voxels, 120);
  const Bytes whole = code(c, voxels, 10, 12).bytes;
  const auto refused = [&](std::size_t at, std::uint8_t value) {
    Bytes b = whole;
    b[at] = value;
    const auto d = decode_channel(b, bounded(c), voxels, {});
    return d.ok() ? ErrorCode{} : d.error().code;
  };
  ASSERT_EQ(whole[1], 8);  // flags
  EXPECT_EQ(refused(1, 4), ErrorCode::kUnsupported);
  EXPECT_EQ(refused(1, 9), ErrorCode::kMalformed);
  EXPECT_EQ(refused(1, 16), ErrorCode::kMalformed);
}

TEST(CoarseColor, LimitsAreKept) {
  const auto voxels = wavy_voxels(1000, 64);
  const Channel c = test::smooth_rgb(voxels, 20);
  DecodeLimits small;
  small.max_bytes = 10000;
  const auto d = decode_channel(code(c, voxels, 10, 12).bytes, bounded(c), voxels, small);
  ASSERT_FALSE(d.ok());
  EXPECT_EQ(d.error().code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace mapcodec
