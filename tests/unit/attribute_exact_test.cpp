// SPDX-License-Identifier: GPL-3.0-or-later
// Channels kept exactly: every type, every bit.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/unit/attribute_fixtures.hpp"

namespace mapcodec {
namespace {

using test::encode;
using test::make_channel;
using test::schema_of;
using test::wavy_voxels;

/// @return bits per value.
double round_trip(const Channel& c, const std::vector<VoxelCoord>& voxels) {
  const ChannelSchema schema = schema_of(c);
  const ChannelEncoding e = encode(schema, c, voxels);
  EXPECT_EQ(e.error, 0);
  EXPECT_EQ(e.decoded.data, c.data);
  const auto d = decode_channel(e.bytes, schema, voxels, {});
  EXPECT_TRUE(d.ok()) << d.error().to_string();
  if (d) {
    EXPECT_EQ(d->data, c.data) << c.info.name;
  }
  return 8.0 * static_cast<double>(e.bytes.size()) /
         static_cast<double>(std::max<std::size_t>(1, c.size() * c.info.components));
}

template <class T>
void round_trip_noise(ScalarType scalar) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{500}}) {
    const auto voxels = wavy_voxels(count, 64);
    for (const std::uint8_t components : {std::uint8_t{1}, std::uint8_t{3}, std::uint8_t{5}}) {
      Channel c{{"any", scalar, components}, Bytes(count * components * sizeof(T))};
      std::mt19937 random(3);
      for (std::uint8_t& b : c.data) b = static_cast<std::uint8_t>(random());
      round_trip(c, voxels);
      std::fill(c.data.begin(), c.data.end(), std::uint8_t{0x81});
      round_trip(c, voxels);
    }
  }
}

TEST(AttributeExact, NoiseOfEveryType) {
  for (int t = 1; t <= 10; ++t) {
    visit_scalar(static_cast<ScalarType>(t),
                 [&](auto zero) { round_trip_noise<decltype(zero)>(static_cast<ScalarType>(t)); });
  }
}

TEST(AttributeExact, FloatsKeepNanPayloadsAndSignsOfZero) {
  const auto voxels = wavy_voxels(300, 64);
  Channel c = make_channel<float>("f", ScalarType::f32, 1, voxels,
                                  [](const VoxelCoord& v, std::size_t, std::uint32_t r) {
                                    switch (r % 7) {
                                      case 0:
                                        return -0.0f;
                                      case 1:
                                        return 0.0f;
                                      case 2:
                                        return std::numeric_limits<float>::infinity();
                                      default:
                                        return 0.1f * static_cast<float>(v[0]);
                                    }
                                  });
  const std::uint32_t odd = 0xffc12345;
  std::memcpy(c.at(5), &odd, 4);
  round_trip(c, voxels);
}

TEST(AttributeExact, TextNumbersWithSomeNansCostLikeIntegers) {
  const auto voxels = wavy_voxels(20000, 4096);
  const Channel c = make_channel<float>(
      "intensity", ScalarType::f32, 1, voxels, [](const VoxelCoord& v, std::size_t, std::uint32_t r) {
        return r % 100 == 0 ? NAN : static_cast<float>((v[0] / 40 + r % 4) / 100.0);
      });
  EXPECT_LT(round_trip(c, voxels), 4.0);
}

TEST(AttributeExact, LabelsAndRingsAreNearlyFree) {
  const auto voxels = wavy_voxels(20000, 4096);
  const Channel label = make_channel<std::uint32_t>(
      "label", ScalarType::u32, 1, voxels,
      [](const VoxelCoord& v, std::size_t, std::uint32_t) { return 1000000 * (1 + v[0] / 700 % 5); });
  EXPECT_LT(round_trip(label, voxels), 0.5);
  const Channel same = make_channel<double>(
      "same", ScalarType::f64, 1, voxels, [](const VoxelCoord&, std::size_t, std::uint32_t) { return M_PI; });
  EXPECT_LT(round_trip(same, voxels), 0.02);
}

TEST(AttributeExact, SmoothColorIsCheapAndGreyCheaper) {
  const auto voxels = wavy_voxels(20000, 4096);
  EXPECT_LT(round_trip(test::smooth_rgb(voxels, 0), voxels), 6.0);
  const Channel grey = make_channel<std::uint16_t>(
      "rgb", ScalarType::u16, 3, voxels,
      [](const VoxelCoord& v, std::size_t, std::uint32_t) { return 257 * (v[0] / 20 % 256); });
  EXPECT_LT(round_trip(grey, voxels), 1.5);
}

TEST(AttributeExact, SameBytesTwice) {
  const auto voxels = wavy_voxels(3000, 512);
  const Channel c = test::smooth_rgb(voxels, 9);
  EXPECT_EQ(encode(schema_of(c), c, voxels).bytes, encode(schema_of(c), c, voxels).bytes);
}

TEST(AttributeExact, AllPointsInOneVoxel) {
  const std::vector<VoxelCoord> voxels(5000, VoxelCoord{2097151, 0, 7});
  round_trip(test::smooth_rgb(voxels, 30), voxels);
}

TEST(AttributeExact, RefusesWhatDoesNotFit) {
  const auto voxels = wavy_voxels(10, 64);
  Channel c = test::smooth_rgb(voxels, 0);
  const auto code_of = [&](const ChannelSchema& s, std::size_t points) {
    const auto e = encode_channel(s, c, std::span(voxels).first(points), Effort::standard);
    return !e && e.error().code == ErrorCode::kInvalidArgument;
  };
  EXPECT_TRUE(code_of(schema_of(c), 9));
  EXPECT_TRUE(code_of(schema_of(c, ChannelKept::dropped), 10));
  EXPECT_TRUE(code_of(schema_of(c, ChannelKept::bounded, NAN), 10));
  ChannelSchema other = schema_of(c);
  other.info.scalar = ScalarType::u16;
  EXPECT_TRUE(code_of(other, 10));
}

TEST(AttributeExact, ConstantChannelsHaveNoBytes) {
  ChannelSchema s;
  s.info = {"alpha", ScalarType::u8, 1};
  s.kept = ChannelKept::constant;
  s.constant.push_back(255);
  const auto d = decode_channel({}, s, wavy_voxels(4, 64), {});
  ASSERT_TRUE(d.ok());
  EXPECT_EQ(d->data, Bytes(4, 255));
  s.constant.clear();
  EXPECT_FALSE(decode_channel({}, s, wavy_voxels(4, 64), {}).ok());
}

}  // namespace
}  // namespace mapcodec
