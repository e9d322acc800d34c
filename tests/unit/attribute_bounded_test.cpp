// SPDX-License-Identifier: GPL-3.0-or-later
// Channels kept within a bound: colours by mean distance, scalars by largest error.
#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/attribute_fixtures.hpp"

namespace mapcodec {
namespace {

using test::encode;
using test::make_channel;
using test::schema_of;
using test::wavy_voxels;

double mean_distance(const Channel& a, const Channel& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += std::hypot(a.at(i)[0] - b.at(i)[0], a.at(i)[1] - b.at(i)[1], a.at(i)[2] - b.at(i)[2]);
  }
  return sum / static_cast<double>(a.size());
}

ChannelEncoding color_round_trip(const Channel& c, const std::vector<VoxelCoord>& voxels, double bound) {
  const ChannelSchema schema = schema_of(c, ChannelKept::bounded, bound);
  ChannelEncoding e = encode(schema, c, voxels);
  EXPECT_LE(e.error, bound);
  const auto d = decode_channel(e.bytes, schema, voxels, {});
  EXPECT_TRUE(d.ok()) << d.error().to_string();
  if (d) {
    EXPECT_EQ(d->data, e.decoded.data);
  }
  return e;
}

TEST(AttributeColor, StaysWithinTheBoundAndUsesIt) {
  const auto voxels = wavy_voxels(20000, 1024);
  const Channel c = test::smooth_rgb(voxels, 40);
  std::size_t last = ~std::size_t{0};
  for (const double bound : {0.5, 2.0, 5.0, 10.0, 30.0}) {
    const ChannelEncoding e = color_round_trip(c, voxels, bound);
    EXPECT_NEAR(e.error, mean_distance(c, e.decoded), 1e-9);
    EXPECT_LT(e.bytes.size(), last);
    last = e.bytes.size();
    if (bound > 1 && bound < 20) {
      EXPECT_GT(e.error, 0.9 * bound);
    }
  }
}

TEST(AttributeColor, EdgesOfSize) {
  for (const std::size_t count : {1, 2, 3, 9, 100}) {
    for (const std::uint32_t side : {1u, 8u, 2097151u}) {
      const auto voxels = wavy_voxels(count, side);
      color_round_trip(test::smooth_rgb(voxels, 200), voxels, 1.5);
      color_round_trip(test::smooth_rgb(voxels, 200), voxels, 20);
    }
  }
}

TEST(AttributeColor, PointsOfOneVoxelAreToldApartWhereTheBoundAsksForIt) {
  const std::vector<VoxelCoord> voxels(1000, VoxelCoord{5, 6, 7});
  const ChannelEncoding e = color_round_trip(test::smooth_rgb(voxels, 150), voxels, 3);
  EXPECT_GT(e.error, 0);
}

TEST(AttributeColor, OneColorCostsAHead) {
  const auto voxels = wavy_voxels(20000, 1024);
  const Channel c =
      make_channel<std::uint8_t>("rgb", ScalarType::u8, 3, voxels,
                                 [](const VoxelCoord&, std::size_t k, std::uint32_t) { return 80 + k; });
  EXPECT_LT(color_round_trip(c, voxels, 10).bytes.size(), 16u);
}

TEST(AttributeColor, SixteenBitScalesAreFoundByTheirValues) {
  const auto voxels = wavy_voxels(5000, 512);
  const Channel eight = test::smooth_rgb(voxels, 30);
  Channel wide;
  wide.info = {"rgb", ScalarType::u16, 3};
  wide.data.resize(voxels.size() * 6);
  Channel narrow = wide;
  for (std::size_t i = 0; i < eight.data.size(); ++i) {
    wide.set<std::uint16_t>(i / 3, static_cast<std::uint16_t>(257 * eight.data[i]), i % 3);
    narrow.set<std::uint16_t>(i / 3, eight.data[i], i % 3);
  }
  const std::size_t size = color_round_trip(eight, voxels, 6).bytes.size();
  EXPECT_EQ(color_round_trip(narrow, voxels, 6).bytes.size(), size);
  EXPECT_NEAR(static_cast<double>(color_round_trip(wide, voxels, 6).bytes.size()), static_cast<double>(size),
              0.1 * static_cast<double>(size));
}

template <class T>
void check_scalar(ScalarType scalar, double bound, double factor) {
  const auto voxels = wavy_voxels(3000, 512);
  const Channel c =
      make_channel<T>("intensity", scalar, 2, voxels, [&](const VoxelCoord& v, std::size_t, std::uint32_t r) {
        if (r % 50 == 0) return std::numeric_limits<T>::max();
        if (r % 50 == 1) return std::numeric_limits<T>::lowest();
        if (std::is_floating_point_v<T> && r % 50 == 2) return std::numeric_limits<T>::quiet_NaN();
        return static_cast<T>(factor * (v[0] / 8 % 100 + r % 5));
      });
  const ChannelSchema schema = schema_of(c, ChannelKept::bounded, bound);
  const ChannelEncoding e = encode(schema, c, voxels);
  EXPECT_LE(e.error, bound);
  const auto d = decode_channel(e.bytes, schema, voxels, {});
  ASSERT_TRUE(d.ok()) << d.error().to_string();
  for (std::size_t i = 0; i < c.size(); ++i) {
    for (std::size_t k = 0; k < 2; ++k) {
      const T x = c.get<T>(i, k), y = d->get<T>(i, k);
      if (std::memcmp(&x, &y, sizeof(T)) == 0) continue;
      ASSERT_LE(std::abs(static_cast<double>(x) - static_cast<double>(y)), bound);
    }
  }
}

TEST(AttributeBounded, ScalarsOfEveryTypeStayWithinTheBound) {
  for (int t = 1; t <= 10; ++t) {
    visit_scalar(static_cast<ScalarType>(t), [&](auto zero) {
      for (const double bound : {0.0, 0.25, 1.0, 3.7})
        check_scalar<decltype(zero)>(static_cast<ScalarType>(t), bound, 1);
    });
  }
  check_scalar<float>(ScalarType::f32, 1e-3, 0.123);
  check_scalar<double>(ScalarType::f64, 1e-9, 1e9 / 7);
}

}  // namespace
}  // namespace mapcodec
