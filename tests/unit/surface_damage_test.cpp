// SPDX-License-Identifier: GPL-3.0-or-later
// Damaged surface tiles: an error, or a result of the right size.
#include <gtest/gtest.h>

#include "tests/unit/surface_support.hpp"

namespace mapcodec::test {
namespace {

Bytes sample(const Cloud& cloud) {
  auto e = encode_surface(cloud, steps_of(0.01), {});
  EXPECT_TRUE(e.ok());
  (void)set_voxels(*e, 8);
  return e->bytes;
}

void expect_sane(const Bytes& bytes, std::uint64_t count) {
  const auto d = decode_surface(bytes, count, steps_of(0.01), {});
  if (!d.ok()) return;
  ASSERT_EQ(d->xyz.size(), count);
  if (!d->voxels.empty()) {
    ASSERT_EQ(d->voxels.size(), count);
  }
}

TEST(SurfaceDamage, CutAtEachLength) {
  const Cloud cloud = room(400, 1, 4);
  const Bytes bytes = sample(cloud);
  for (std::size_t n = 0; n < bytes.size(); ++n)
    expect_sane(Bytes(bytes.begin(), bytes.begin() + std::ptrdiff_t(n)), cloud.size());
}

TEST(SurfaceDamage, EachByteFlipped) {
  const Cloud cloud = room(400, 1, 4);
  const Bytes bytes = sample(cloud);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
      Bytes damaged = bytes;
      damaged[i] ^= flip;
      expect_sane(damaged, cloud.size());
    }
  }
}

TEST(SurfaceDamage, WrongCounts) {
  const Cloud cloud = room(400, 1, 4);
  const Bytes bytes = sample(cloud);
  for (const std::uint64_t count : {0ull, 1ull, 2ull, 399ull, 401ull, 100000ull, 1ull << 40})
    expect_sane(bytes, count);
}

TEST(SurfaceDamage, CountsAreCheckedBeforeMemoryIsTaken) {
  const Bytes bytes = sample(room(400, 1, 4));
  DecodeLimits limits;
  limits.max_bytes = 1 << 20;
  EXPECT_EQ(decode_surface(bytes, 1 << 20, steps_of(0.01), limits).error().code, ErrorCode::kLimitExceeded);
  limits = {};
  limits.max_points = 100;
  EXPECT_EQ(decode_surface(bytes, 400, steps_of(0.01), limits).error().code, ErrorCode::kLimitExceeded);
}

TEST(SurfaceDamage, HeadersOutOfRange) {
  const Bytes bytes = sample(room(400, 1, 4));
  ByteReader in(bytes);
  const auto header = surface::read_header(in);
  ASSERT_TRUE(header.ok());
  const auto refuses = [&](auto change) {
    surface::Header h = *header;
    change(h);
    ByteWriter out;
    surface::write_header(out, h);
    out.raw(ByteSpan(bytes).subspan(in.offset()));
    const Bytes changed = out.take();
    EXPECT_EQ(decode_surface(changed, 400, steps_of(0.01), {}).error().code, ErrorCode::kMalformed);
  };
  refuses([](surface::Header& h) { h.depth = 22; });
  refuses([](surface::Header& h) { h.count_shift = 32; });
  refuses([](surface::Header& h) { h.block_bits = 22; });
  refuses([](surface::Header& h) { h.voxel_shift = 26; });
  refuses([](surface::Header& h) { h.base[1] = surface::kMostBase + 1; });
}

}  // namespace
}  // namespace mapcodec::test
