// SPDX-License-Identifier: GPL-3.0-or-later
// Damaged and lying bytes: an error or the right number of points, never a crash.
#include <gtest/gtest.h>

#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/codec/points_encoder.hpp"
#include "tests/unit/points_support.hpp"

namespace mapcodec {
namespace {

const Quantizer kQuantizer{{0, 0, 0}, 0.01, CoordinateFormat::Kind::f32};

std::vector<PointsEncoding> samples() {
  std::vector<PointsEncoding> all;
  for (const Effort effort : {Effort::fast, Effort::standard, Effort::high}) {
    all.push_back(encode_points(test::room(600, 0.5, 1), kQuantizer, {effort, true}).value());
    all.push_back(encode_points(test::sparse(150, 40, 2), kQuantizer, {effort, false}).value());
    all.push_back(encode_points(test::Cloud(5000, Vec3{1, 1, 1}), kQuantizer, {effort, true}).value());
  }
  return all;
}

void expect_sane(ByteSpan bytes, std::uint64_t count) {
  const auto decoded = decode_points(bytes, count, kQuantizer, {});
  if (!decoded) return;
  EXPECT_EQ(decoded->xyz.size(), count);
  EXPECT_EQ(decoded->voxels.size(), count);
}

TEST(PointsDamage, CutAtEachLength) {
  for (const PointsEncoding& e : samples()) {
    for (std::size_t n = 0; n < e.bytes.size(); ++n)
      expect_sane(ByteSpan(e.bytes).first(n), e.decoded.size());
  }
}

TEST(PointsDamage, EachByteFlipped) {
  for (const PointsEncoding& e : samples()) {
    for (std::size_t i = 0; i < e.bytes.size(); ++i) {
      for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
        Bytes bytes = e.bytes;
        bytes[i] ^= flip;
        expect_sane(bytes, e.decoded.size());
      }
    }
  }
}

TEST(PointsDamage, FarTooShortIsTruncated) {
  const PointsEncoding e = samples()[1];
  for (std::size_t n = 0; n < e.bytes.size() / 2; ++n) {
    EXPECT_FALSE(decode_points(ByteSpan(e.bytes).first(n), e.decoded.size(), kQuantizer, {}).ok()) << n;
  }
}

TEST(PointsDamage, WrongCountIsRefused) {
  for (const PointsEncoding& e : samples()) {
    for (const std::uint64_t count : {std::uint64_t{0}, e.decoded.size() - 1, e.decoded.size() + 1}) {
      EXPECT_FALSE(decode_points(e.bytes, count, kQuantizer, {}).ok());
    }
  }
}

TEST(PointsDamage, LimitsAreKept) {
  const PointsEncoding e = samples()[0];
  DecodeLimits few;
  few.max_points = e.decoded.size() - 1;
  EXPECT_EQ(decode_points(e.bytes, e.decoded.size(), kQuantizer, few).error().code,
            ErrorCode::kLimitExceeded);
  DecodeLimits small;
  small.max_bytes = 2000;
  EXPECT_EQ(decode_points(e.bytes, e.decoded.size(), kQuantizer, small).error().code,
            ErrorCode::kLimitExceeded);
  EXPECT_EQ(decode_points(e.bytes, ~std::uint64_t{0}, kQuantizer, {}).error().code,
            ErrorCode::kLimitExceeded);
}

TEST(PointsDamage, HugeClaimsFailQuickly) {
  for (std::uint32_t mode = 0; mode < 256; ++mode) {
    for (const std::uint8_t fill : {0x00, 0x55, 0xff}) {
      Bytes bytes(40, fill);
      bytes[0] = bytes[1] = bytes[2] = 0;
      bytes[3] = 21;
      bytes[4] = static_cast<std::uint8_t>(mode);
      expect_sane(bytes, std::uint64_t{1} << 27);
    }
  }
}

}  // namespace
}  // namespace mapcodec
