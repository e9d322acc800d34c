// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/e57_support.hpp"
#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using namespace e57_test;
using Kind = CoordinateFormat::Kind;

ReadBack read_e57(const std::string& bytes) {
  return read_text(bytes, "scan.e57");
}

TEST(E57, FloatsColourAndStates) {
  for (const std::size_t pieces : {1u, 2u, 7u}) {
    const ReadBack r = read_e57(write_e57({colored_scan()}, pieces));
    ASSERT_TRUE(r.status.ok()) << message(r);
    ASSERT_EQ(r.cloud.size(), 90u);
    EXPECT_EQ(r.dropped, 10u);
    EXPECT_EQ(r.cloud.coordinates.kind, Kind::f32);
    EXPECT_EQ(r.cloud.xyz[20], (Vec3{11, -22, 7}));
    EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(20, 1), 22);
    EXPECT_EQ(r.cloud.find("intensity")->get<std::uint8_t>(20), 5);
    EXPECT_EQ(r.cloud.find("row")->get<std::uint8_t>(20), 22 % 3);
  }
}

TEST(E57, ScaledIntegersStayFixed) {
  Scan s;
  s.records = 3;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
    s.fields.push_back(scaled(name, "0.001", "1000", 100000, {0, 12345, 100000}));
  const ReadBack r = read_e57(write_e57({s}));
  ASSERT_EQ(r.cloud.size(), 3u) << message(r);
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::fixed);
  EXPECT_EQ(r.cloud.coordinates.scale[0], 0.001);
  EXPECT_NEAR(r.cloud.xyz[1][2], 1012.345, 1e-12);
  s.fields[0].attributes = "type=\"ScaledInteger\" minimum=\"0\" maximum=\"5000000000\" scale=\"0.001\"";
  s.fields[0] = scaled("cartesianX", "0.001", "0", 5'000'000'000, {0, 4'999'999'999, 1});
  const ReadBack wide = read_e57(write_e57({s}));
  ASSERT_EQ(wide.cloud.size(), 3u) << message(wide);
  EXPECT_EQ(wide.cloud.coordinates.kind, Kind::f64);
  EXPECT_NEAR(wide.cloud.xyz[1][0], 4999999.999, 1e-6);
}

TEST(E57, SphericalWithPose) {
  const double pi = std::numbers::pi;
  Scan s;
  s.records = 2;
  s.fields = {doubles("sphericalRange", {2, 1}), doubles("sphericalAzimuth", {pi / 2, 0}),
              doubles("sphericalElevation", {0, pi / 2})};
  s.pose =
      "<pose><rotation><w>0.70710678118654757</w><z>0.70710678118654757</z></rotation>"
      "<translation><x>10</x><z>-1</z></translation></pose>";
  const ReadBack r = read_e57(write_e57({s}));
  ASSERT_EQ(r.cloud.size(), 2u) << message(r);
  EXPECT_NEAR(r.cloud.xyz[0][0], 8, 1e-12);
  EXPECT_NEAR(r.cloud.xyz[0][1], 0, 1e-12);
  EXPECT_NEAR(r.cloud.xyz[1][0], 10, 1e-12);
  EXPECT_NEAR(r.cloud.xyz[1][2], 0, 1e-12);
}

TEST(E57, SeveralScansKeepWhatAllHave) {
  Scan a = colored_scan(), b = colored_scan(5);
  b.fields[7] = integers("rowIndex", 0, 70000, {0, 1, 2, 3, 70000});
  b.fields.push_back(doubles("timeStamp", {1, 2, 3, 4, 5}));
  const ReadBack r = read_e57(write_e57({a, b}, 2, "<images2D><vectorChild/><vectorChild/></images2D>"));
  ASSERT_EQ(r.cloud.size(), 95u) << message(r);
  EXPECT_EQ(r.cloud.find("row")->get<std::uint32_t>(94), 70000u);
  EXPECT_EQ(r.cloud.find("time"), nullptr);
  EXPECT_EQ(r.warnings.size(), 2u);
}

TEST(E57, BrokenFilesAreNamed) {
  const std::string whole = write_e57({colored_scan()});
  std::string bytes = whole;
  bytes[1100] = static_cast<char>(bytes[1100] ^ 1);
  EXPECT_TRUE(fails_with(read_e57(bytes), ErrorCode::kMalformed, "checksum"));
  EXPECT_TRUE(fails_with(read_e57(bytes), ErrorCode::kMalformed, "at byte 1024"));
  EXPECT_TRUE(fails_with(read_e57(whole.substr(0, 1500)), ErrorCode::kTruncated, "announces"));
  Scan more = colored_scan();
  more.records = 105;
  EXPECT_TRUE(fails_with(read_e57(write_e57({more})), ErrorCode::kTruncated, "before its last point"));
  more.records = 1ull << 60;
  EXPECT_TRUE(fails_with(read_e57(write_e57({more})), ErrorCode::kTruncated, "announces"));
  Scan none = colored_scan();
  none.fields.erase(none.fields.begin());
  EXPECT_TRUE(fails_with(read_e57(write_e57({none})), ErrorCode::kMalformed, "without coordinates"));
  none.records = 0;
  EXPECT_TRUE(fails_with(read_e57(write_e57({none})), ErrorCode::kEmpty, "no point"));
  EXPECT_TRUE(fails_with(read_e57(write_e57({colored_scan()}, 1, "<broken")), ErrorCode::kMalformed, "XML"));
}

/// Damage behind the checksums: pages are made anew around it.
TEST(E57, CutAndFlippedFilesNeverCrash) {
  const std::string whole = write_e57({colored_scan(20)}, 2);
  std::string logical;
  for (std::size_t at = 0; at < whole.size(); at += 1024) logical += whole.substr(at, 1020);
  for (std::size_t i = 0; i < logical.size(); ++i) {
    for (const int flip : {0x01, 0xff}) {
      logical[i] = static_cast<char>(logical[i] ^ flip);
      (void)read_e57(paged(logical));
      logical[i] = static_cast<char>(logical[i] ^ flip);
    }
  }
  for (std::size_t size = 0; size < whole.size(); size += 7)
    EXPECT_FALSE(read_e57(whole.substr(0, size)).status.ok()) << size;
}

}  // namespace
}  // namespace mapcodec
