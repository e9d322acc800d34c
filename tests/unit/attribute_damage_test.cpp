// SPDX-License-Identifier: GPL-3.0-or-later
// Damaged channel sections give an error or a channel of the right size.
#include <gtest/gtest.h>

#include "tests/unit/attribute_fixtures.hpp"

namespace mapcodec {
namespace {

void damage(const ChannelSchema& schema, const Channel& c, const std::vector<VoxelCoord>& voxels) {
  const Bytes whole = test::encode(schema, c, voxels).bytes;
  const auto check = [&](const Bytes& b) {
    const auto d = decode_channel(b, schema, voxels, {});
    if (d) {
      EXPECT_EQ(d->data.size(), c.data.size());
    }
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

TEST(AttributeDamage, CutAndFlipped) {
  const auto voxels = test::wavy_voxels(150, 64);
  const Channel rgb = test::smooth_rgb(voxels, 20);
  damage(test::schema_of(rgb), rgb, voxels);
  damage(test::schema_of(rgb, ChannelKept::bounded, 3), rgb, voxels);
  const Channel f = test::make_channel<float>("f", ScalarType::f32, 1, voxels,
                                              [](const VoxelCoord& v, std::size_t, std::uint32_t r) {
                                                return r % 9 == 0 ? NAN : 0.01f * static_cast<float>(v[0]);
                                              });
  damage(test::schema_of(f), f, voxels);
  damage(test::schema_of(f, ChannelKept::bounded, 0.1), f, voxels);
  const Channel label = test::make_channel<std::uint32_t>(
      "label", ScalarType::u32, 1, voxels,
      [](const VoxelCoord& v, std::size_t, std::uint32_t) { return 1000 * (v[0] / 8); });
  damage(test::schema_of(label), label, voxels);
}

TEST(AttributeDamage, LimitsAreKept) {
  const auto voxels = test::wavy_voxels(1000, 64);
  const Channel rgb = test::smooth_rgb(voxels, 20);
  DecodeLimits small;
  small.max_bytes = 10000;
  for (const auto& schema : {test::schema_of(rgb), test::schema_of(rgb, ChannelKept::bounded, 3)}) {
    const auto d = decode_channel(test::encode(schema, rgb, voxels).bytes, schema, voxels, small);
    ASSERT_FALSE(d.ok());
    EXPECT_EQ(d.error().code, ErrorCode::kLimitExceeded);
  }
}

}  // namespace
}  // namespace mapcodec
