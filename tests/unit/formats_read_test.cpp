// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using Kind = CoordinateFormat::Kind;

template <class T>
std::string raw(std::initializer_list<T> values, bool big = false) {
  std::string r;
  for (T v : values) {
    char b[sizeof(T)];
    std::memcpy(b, &v, sizeof(T));
    if (big) std::reverse(b, b + sizeof(T));
    r.append(b, sizeof(T));
  }
  return r;
}

std::string pcd(const std::string& fields, const std::string& size, const std::string& type, int points,
                const std::string& data, const std::string& body, const std::string& count = "") {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " + size + "\nTYPE " + type + "\n" +
         (count.empty() ? "" : "COUNT " + count + "\n") + "WIDTH " + std::to_string(points) +
         "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + std::to_string(points) + "\nDATA " + data + "\n" +
         body;
}
std::string pcd_xyz(int points, const std::string& body) {
  return pcd("x y z", "4 4 4", "F F F", points, "ascii", body);
}

TEST(PcdRead, AsciiWithColorNormalAndPadding) {
  const auto r = read_text(pcd("x y z _ rgb normal_x normal_y normal_z curvature ring", "4 4 4 1 4 4 4 4 4 2",
                               "F F F U U F F F F U", 1, "ascii", "1 2.5 -3e-1 9 9 4278321666 0 0 1 0.25 7\n",
                               "1 1 1 2 1 1 1 1 1 1"));
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 1u);
  EXPECT_EQ(r.cloud.xyz[0][2], double(-0.3f));
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f32);
  const Channel* rgb = r.cloud.find("rgb");
  ASSERT_NE(rgb, nullptr);
  EXPECT_EQ(rgb->info.type_name(), "u8x3");
  // 4278321666 = 0xFF020202 + ...: bytes are alpha, red, green, blue from the top.
  const std::uint32_t packed = 4278321666u;
  EXPECT_EQ(rgb->get<std::uint8_t>(0, 0), (packed >> 16) & 255);
  EXPECT_EQ(rgb->get<std::uint8_t>(0, 1), (packed >> 8) & 255);
  EXPECT_EQ(rgb->get<std::uint8_t>(0, 2), packed & 255);
  EXPECT_EQ(r.cloud.find("alpha")->get<std::uint8_t>(0), packed >> 24);
  EXPECT_EQ(r.cloud.find("normal")->get<float>(0, 2), 1.0f);
  EXPECT_EQ(r.cloud.find("curvature")->get<float>(0), 0.25f);
  EXPECT_EQ(r.cloud.find("ring")->get<std::uint16_t>(0), 7);
  EXPECT_EQ(r.cloud.find("_"), nullptr);
}

TEST(PcdRead, BinaryDoublesAndIntegers) {
  const auto r = read_text(pcd("x y z t", "8 8 8 8", "F F F U", 1, "binary",
                               raw<double>({1e6 + 0.001, 2, 3}) + raw<std::uint64_t>({~0ull})));
  ASSERT_TRUE(r.status.ok()) << message(r);
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f64);
  EXPECT_EQ(r.cloud.xyz[0][0], 1e6 + 0.001);
  EXPECT_EQ(r.cloud.find("t")->get<std::uint64_t>(0), ~0ull);
  EXPECT_TRUE(r.warnings.empty());
  const auto ints = read_text(pcd("x y z", "2 2 2", "I I U", 1, "binary", raw<std::int16_t>({-5, 6, 7})));
  ASSERT_TRUE(ints.status.ok());
  EXPECT_EQ(ints.cloud.xyz[0], (Vec3{-5, 6, 7}));
}

TEST(PcdRead, NonFiniteAreDroppedAndCounted) {
  const std::string text = pcd_xyz(4, "1 2 3\nnan 0 0\n0 -inf 0\n4 5 6\n");
  const auto r = read_text(text);
  ASSERT_TRUE(r.status.ok()) << message(r);
  EXPECT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.dropped, 2u);
  EXPECT_EQ(r.cloud.xyz[1], (Vec3{4, 5, 6}));
  const auto kept = read_text(text, "c", {.keep_nonfinite = true});
  EXPECT_EQ(kept.cloud.size(), 4u);
  EXPECT_EQ(kept.dropped, 0u);
}

TEST(PcdRead, GridAndViewpointAreSaidNotToBeKept) {
  const auto warned = [](const std::string& grid, const std::string& viewpoint) {
    const auto r = read_text("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n" + grid + viewpoint +
                             "DATA ascii\n1 2 3\n4 5 6\n");
    EXPECT_TRUE(r.status.ok()) << message(r);
    EXPECT_LE(r.warnings.size(), 1u);
    return r.warnings.empty() ? std::string() : r.warnings[0];
  };
  EXPECT_EQ(warned("WIDTH 2\nHEIGHT 1\n", ""), "");
  EXPECT_EQ(warned("WIDTH 2\nHEIGHT 1\n", "VIEWPOINT 0 0 0 1 0 0 0\n"), "");
  EXPECT_EQ(warned("POINTS 2\n", "VIEWPOINT -0.0 0 0 1.0 0 0 0\n"), "");
  EXPECT_EQ(warned("WIDTH 1\nHEIGHT 2\n", "VIEWPOINT 0 0 0 1 0 0 0\n"),
            "cloud: its grid of 1 x 2 points is not kept");
  EXPECT_EQ(warned("WIDTH 2\nHEIGHT 1\n", "VIEWPOINT 0 0 1.5 1 0 0 0\n"), "cloud: its VIEWPOINT is not kept");
  EXPECT_EQ(warned("WIDTH 2\nHEIGHT 1\n", "VIEWPOINT 0 0 0\n"), "cloud: its VIEWPOINT is not kept");
  EXPECT_EQ(warned("WIDTH 1\nHEIGHT 2\n", "VIEWPOINT 0 0 0 0 1 0 0\n"),
            "cloud: its grid of 1 x 2 points and its VIEWPOINT are not kept");
}

TEST(PcdRead, Float32FarFromOriginWarns) {
  const auto r = read_text(pcd_xyz(1, "500000 2 3\n"));
  ASSERT_EQ(r.warnings.size(), 1u);
  EXPECT_NE(r.warnings[0].find("500000"), std::string::npos) << r.warnings[0];
  EXPECT_NE(r.warnings[0].find("0.0312"), std::string::npos) << r.warnings[0];
}

TEST(PcdRead, UnitScalesAndWidens) {
  const auto r = read_text(pcd_xyz(1, "100 200 300\n"), "c", {.unit_m = 0.01});
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f64);
  EXPECT_DOUBLE_EQ(r.cloud.xyz[0][2], 3);
}

TEST(PcdRead, Errors) {
  using enum ErrorCode;
  const struct {
    std::string text;
    ErrorCode code;
    const char* part;
  } kCases[] = {
      {pcd_xyz(3, "1 2 3\n4 5 6 \n\n   \n\n"), kTruncated, "announces 3 points, but ends after 2"},
      {pcd_xyz(1, "1 2 3\n4 5 6\n"), kMalformed, "line 12: more data follows the 1 points"},
      {pcd_xyz(1, "1 2 three\n"), kMalformed, "line 11: 'three' is no f32 number for 'z'"},
      {pcd_xyz(1, "1 2      \n"), kMalformed, "line 11: has too few numbers"},
      {pcd_xyz(1, "1 2 3 4\n"), kMalformed, "more numbers than the header has fields, from '4'"},
      {pcd_xyz(0, ""), kEmpty, "holds no point"},
      {pcd_xyz(1000000000, "1 2 3\n"), kTruncated, "announces 1000000000 points"},
      {pcd("x y z", "4 4 4", "F F F", 2, "binary", std::string(12, '\0')), kTruncated,
       "announces 2 points of 12 bytes, but holds 1"},
      {pcd("x y z", "4 4 4", "F F F", 1, "binary", std::string(13, '\0')), kMalformed,
       "announces 1 points of 12 bytes, but holds 1 (13"},
      {pcd("x y", "4 4", "F F", 1, "ascii", "1 2\n"), kMalformed, "no field z"},
      {pcd("x y z", "4 4 3", "F F F", 1, "ascii", "1 2 3\n"), kMalformed, "'z' has TYPE 'F' SIZE '3'"},
      {pcd("x y z", "4 4 4", "F F Q", 1, "ascii", "1 2 3\n"), kMalformed, "'z' has TYPE 'Q'"},
      {pcd("x y z", "4 4", "F F F", 1, "ascii", "1 2 3\n"), kMalformed, "different lengths"},
      {pcd("x y z z", "4 4 4 4", "F F F F", 1, "ascii", "1 2 3 4\n"), kMalformed, "z twice"},
      {pcd("x y z", "4 4 4", "F F F", 1, "zipped", ""), kMalformed, "'zipped'"},
      {"VERSION 0.7\nFIELDS x y z\n", kTruncated, "without a DATA line"},
      {"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nHEIGHT 2\nPOINTS 5\nDATA ascii\n",
       kMalformed, "POINTS is 5 but WIDTH times HEIGHT is 6"},
      {"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH -3\n", kMalformed, "line 5: WIDTH"},
      {"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 9999999999999\nHEIGHT 9999999999999\nDATA "
       "ascii\n",
       kMalformed, "overflows"},
      {pcd("x y z", "4 4 4", "F F F", 2, "binary_compressed", raw<std::uint32_t>({4, 24}) + "abcd"),
       kMalformed, "damaged"},
      {pcd("x y z", "4 4 4", "F F F", 2, "binary_compressed", raw<std::uint32_t>({4, 12}) + "abcd"),
       kMalformed, "unpack to 12 bytes (1 points)"},
      {pcd("x y z", "4 4 4", "F F F", 2, "binary_compressed", raw<std::uint32_t>({9, 24}) + "abcd"),
       kTruncated, "announces 9 bytes"},
      {pcd("x y z", "4 4 4", "F F F", 200000000, "binary_compressed",
           raw<std::uint32_t>({4, 2400000000u}) + "abcd"),
       kMalformed, "cannot hold"},
  };
  for (const auto& c : kCases) {
    const auto r = read_text(c.text, "map.pcd");
    EXPECT_TRUE(fails_with(r, c.code, c.part)) << message(r) << "\n  wanted: " << c.part;
    EXPECT_TRUE(message(r).starts_with("map.pcd: ")) << message(r);
  }
}

TEST(PcdRead, ErrorStaysUntilRewind) {
  const std::string text = pcd_xyz(2, "1 2 3\nx 5 6\n");
  auto s = open_source_memory(ByteSpan(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), "a");
  ASSERT_TRUE(s.ok());
  PointCloud block;
  EXPECT_FALSE((*s)->next(block).ok());
  EXPECT_FALSE((*s)->next(block).ok());
  EXPECT_TRUE(block.empty());
  EXPECT_TRUE((*s)->rewind().ok());
  EXPECT_FALSE((*s)->next(block).ok());
}

std::string ply(const std::string& format, const std::string& header, const std::string& body) {
  return "ply\nformat " + format + " 1.0\ncomment made for a test\n" + header + "end_header\n" + body;
}
constexpr const char* kVertex = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\n";

TEST(PlyRead, AsciiWithListsAndOtherElements) {
  const auto r = read_text(ply("ascii",
                               "element camera 1\nproperty int id\nelement vertex 2\nproperty double "
                               "x\nproperty double y\nproperty double z\n"
                               "property list uchar int seen_by\nproperty uchar red\nproperty uchar "
                               "green\nproperty uchar blue\nproperty uchar alpha\n"
                               "property float nx\nproperty float ny\nproperty float nz\nelement face "
                               "1\nproperty list uchar int vertex_indices\n",
                               "77\n1 2 3.1 2 5 6 10 20 30 40 0 0 1\n4 5 6 0 11 21 31 41 1 0 0\n3 0 1 1\n"));
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f64);
  EXPECT_EQ(r.cloud.xyz[0][2], 3.1);
  EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(1, 2), 31);
  EXPECT_EQ(r.cloud.find("alpha")->get<std::uint8_t>(0), 40);
  EXPECT_EQ(r.cloud.find("normal")->get<float>(1, 0), 1.0f);
  ASSERT_EQ(r.warnings.size(), 1u);
}

TEST(PlyRead, BothEndiansGiveTheSame) {
  for (const bool big : {false, true}) {
    const std::string body = raw<std::uint8_t>({2}) + raw<std::int32_t>({7, 8}, big) +
                             raw<float>({1, 2, 3}, big) + raw<std::uint16_t>({300}, big) +
                             raw<std::uint8_t>({0}) + raw<float>({4, 5, 6}, big) +
                             raw<std::uint16_t>({301}, big);
    const auto r = read_text(ply(big ? "binary_big_endian" : "binary_little_endian",
                                 "element face 0\nproperty list uchar int v\nelement vertex 2\nproperty list "
                                 "uchar int a\nproperty float x\n"
                                 "property float y\nproperty float z\nproperty ushort ring\n",
                                 body));
    ASSERT_TRUE(r.status.ok()) << message(r);
    ASSERT_EQ(r.cloud.size(), 2u);
    EXPECT_EQ(r.cloud.xyz[1], (Vec3{4, 5, 6}));
    EXPECT_EQ(r.cloud.find("ring")->get<std::uint16_t>(1), 301);
  }
}

TEST(PlyRead, Errors) {
  using enum ErrorCode;
  const std::string three = raw<float>({1, 2, 3});
  const struct {
    std::string text;
    ErrorCode code;
    const char* part;
  } kCases[] = {
      {ply("ascii", kVertex, "1 2 3\n  \n   \n"), kTruncated, "announces 2 points, but ends after 1"},
      {ply("ascii", kVertex, "1 2 3\n4 5 6\n7 8 9\n"), kMalformed, "line 11: more data"},
      {ply("ascii", kVertex, "1 2 3\n4 five 6\n"), kMalformed, "line 10: 'five'"},
      {ply("binary_little_endian", kVertex, three), kTruncated,
       "announces 2 points of 12 bytes, but holds 1"},
      {ply("binary_little_endian", kVertex, three + three + "x"), kMalformed, "(25 bytes"},
      {ply("binary_little_endian", std::string(kVertex) + "element face 1\nproperty list uchar int v\n",
           three + three),
       kTruncated, "'face', but ends after 0"},
      {ply("binary_middle_endian", kVertex, ""), kMalformed, "'binary_middle_endian'"},
      {ply("ascii", "element vertex two\n", ""), kMalformed, "'two'"},
      {ply("ascii", "element vertex 1\nproperty quad x\n", ""), kMalformed, "line 5: 'quad' is no PLY type"},
      {ply("ascii", "element face 1\nproperty int v\n", "1\n"), kEmpty, "no element vertex"},
      {ply("ascii", "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n", ""), kEmpty,
       "0 vertices"},
      {ply("ascii",
           "element vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty float z\n",
           "1 2 3\n"),
       kTruncated, "announces"},
      {"ply\nformat ascii 1.0\n", kTruncated, "without end_header"},
  };
  for (const auto& c : kCases) {
    const auto r = read_text(c.text, "map.ply");
    EXPECT_TRUE(fails_with(r, c.code, c.part)) << message(r) << "\n  wanted: " << c.part;
  }
}

TEST(TextRead, ColumnsDecide) {
  const auto names = [](const std::string& text) {
    const auto r = read_text(text, "c.xyz");
    std::string s = message(r) + ":";
    for (const Channel& c : r.cloud.channels) s += " " + c.info.name + "/" + c.info.type_name();
    return s;
  };
  EXPECT_EQ(names("1 2 3\n4 5 6\n"), "no error:");
  EXPECT_EQ(names("1 2 3 0.5\n"), "no error: intensity/f32");
  EXPECT_EQ(names("1 2 3 1399383928.12345\n"), "no error: intensity/f64");
  EXPECT_EQ(names("1,2,3,255,0,7\n"), "no error: rgb/u8x3");
  EXPECT_EQ(names("1;2;3;65535;0;7\n"), "no error: rgb/u16x3");
  EXPECT_EQ(names("1 2 3 0.0 -1.0 0.0\n"), "no error: normal/f32x3");
  EXPECT_EQ(names("1 2 3 -1200 1 2 3\n"), "no error: intensity/f32 rgb/u8x3");
  EXPECT_EQ(names("1 2 3 1 2 3 0.5\n"), "no error: rgb/u8x3 intensity/f32");
  EXPECT_EQ(names("1 2 3 4 5\n"), "no error: column_4/f32 column_5/f32");
  EXPECT_EQ(names("//X Y Z R G B\n1 2 3 9 8 7\n"), "no error: rgb/u8x3");
  EXPECT_EQ(names("x,y,z,ring\n1,2,3,4\n"), "no error: ring/f32");
  EXPECT_EQ(names("# x:f32 y:f32 z:f32 ring:u16\n1 2 3 4\n"), "no error: ring/u16");
}

TEST(TextRead, CarriageReturnsCommentsMarkAndMissingLastEnd) {
  const auto r = read_text("\xEF\xBB\xBF# made by hand\r\n\r\n1 2 3\r\n# in between\r\n+4 5e0 6", "c.txt");
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.cloud.xyz[1], (Vec3{4, 5, 6}));
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f64);
}

TEST(TextRead, Errors) {
  using enum ErrorCode;
  EXPECT_TRUE(fails_with(read_text("1 2 3\n4 x 6\n", "c.xyz"), kMalformed, "line 2: 'x' is no number"));
  EXPECT_TRUE(fails_with(read_text("1 2\n", "c.xyz"), kMalformed, "fewer than three"));
  EXPECT_TRUE(fails_with(read_text("1 2 3\n4 5\n", "c.xyz"), kMalformed, "line 2: has too few"));
  EXPECT_TRUE(fails_with(read_text("# nothing\n", "c.xyz"), kEmpty, "no line of numbers"));
  EXPECT_TRUE(fails_with(read_text("", "c.xyz"), kEmpty, "0 bytes"));
  EXPECT_TRUE(fails_with(read_text("hello\nworld\n", "c.xyz"), kMalformed, "'world'"));
  EXPECT_TRUE(fails_with(read_text("hello\nworld\n", "c.dat"), kUnsupported, "not recognised"));
}

TEST(PtsRead, BlocksAndErrors) {
  const auto r = read_text("2\n1 2 3 -4 5 6 7\n2 2 3 -5 5 6 8\n1\n9 9 9 1 0 0 0\n", "c.pts");
  ASSERT_TRUE(r.status.ok()) << message(r);
  EXPECT_EQ(r.cloud.size(), 3u);
  EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(1, 2), 8);
  const auto more = read_text("1\n1 2 3\n4 5 6\n", "c.pts");
  EXPECT_EQ(more.cloud.size(), 1u);
  EXPECT_EQ(more.warnings.size(), 1u);
  EXPECT_TRUE(fails_with(read_text("3\n1 2 3\n4 5 6     \n", "c.pts"), ErrorCode::kTruncated,
                         "announces 3 points, but ends after 2"));
  EXPECT_TRUE(fails_with(read_text("99999999999\n1 2 3\n", "c.pts"), ErrorCode::kTruncated,
                         "announces 99999999999 points"));
  EXPECT_TRUE(fails_with(read_text("0\n", "c.pts"), ErrorCode::kEmpty, "no point"));
}

TEST(PtxRead, TransformsEachScanAndDropsNoReturns) {
  const std::string axes = "1 0 0\n0 1 0\n0 0 1\n";
  const std::string scan1 =
      "1\n2\n0 0 0\n" + axes + "0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n" + "1 0 0 0.5\n0 0 0 0.5\n";
  const std::string scan2 =
      "2\n1\n0 0 0\n" + axes + "1 0 0 0\n0 1 0 0\n0 0 1 0\n500000 0 0 1\n" + "1 2 3 0.25\n4 5 6 0.75\n";
  const auto r = read_text(scan1 + scan2, "c.ptx");
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 3u);
  EXPECT_EQ(r.dropped, 1u);
  EXPECT_EQ(r.cloud.xyz[0], (Vec3{10, 21, 30}));
  EXPECT_EQ(r.cloud.xyz[2], (Vec3{500004, 5, 6}));
  EXPECT_EQ(r.cloud.find("intensity")->get<float>(2), 0.75f);
  EXPECT_TRUE(fails_with(read_text(scan1 + "2\n1\n0 0 0\n", "c.ptx"), ErrorCode::kTruncated, "PTX header"));
  EXPECT_TRUE(fails_with(read_text("4000000000\n4000000000\n0 0 0\n", "c.ptx"), ErrorCode::kTruncated,
                         "announces 4000000000 x"));
}

TEST(KittiRead, FourFloats) {
  const auto r = read_text(raw<float>({1, 2, 3, 0.5f, 4, 5, 6, 0.25f}), "000000.bin");
  ASSERT_TRUE(r.status.ok()) << message(r);
  EXPECT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.cloud.find("intensity")->get<float>(1), 0.25f);
  EXPECT_TRUE(fails_with(read_text(raw<float>({1, 2, 3}), "0.bin"), ErrorCode::kMalformed, "12 bytes"));
}

TEST(VtkRead, AsciiAndBinary) {
  const std::string head = "# vtk DataFile Version 3.0\nt\n";
  const auto r = read_text(head +
                               "ASCII\nDATASET POLYDATA\nPOINTS 2 double\n1 2 3 4\n5 6\nVERTICES 2 4\n1 0\n1 "
                               "1\n\nPOINT_DATA 2\nSCALARS time float 1\n"
                               "LOOKUP_TABLE default\n0.5 1.5\nNORMALS n float\n0 0 1\n0 1 0\nFIELD f 1\nrgb "
                               "3 2 unsigned_char\n1 2 3 4 5 6\n",
                           "c.vtk");
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.cloud.xyz[1], (Vec3{4, 5, 6}));
  EXPECT_EQ(r.cloud.find("time")->get<float>(1), 1.5f);
  EXPECT_EQ(r.cloud.find("normal")->get<float>(1, 1), 1.0f);
  EXPECT_EQ(r.cloud.find("rgb")->get<std::uint8_t>(1, 2), 6);
  const auto b =
      read_text(head + "BINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n" + raw<float>({1, 2, 3}, true) +
                    "\nCELLS 1 2\n" + raw<std::int32_t>({1, 0}, true) + "\nCELL_TYPES 1\n" +
                    raw<std::int32_t>({1}, true) + "\n",
                "c.vtk");
  ASSERT_TRUE(b.status.ok()) << message(b);
  EXPECT_EQ(b.cloud.xyz[0], (Vec3{1, 2, 3}));
  EXPECT_TRUE(
      fails_with(read_text(head + "BINARY\nDATASET POLYDATA\nPOINTS 9 float\n" + raw<float>({1, 2}), "c.vtk"),
                 ErrorCode::kTruncated, "announces 9 x 3"));
  EXPECT_TRUE(fails_with(read_text(head + "ASCII\nDATASET STRUCTURED_POINTS\n", "c.vtk"),
                         ErrorCode::kUnsupported, "STRUCTURED_POINTS"));
  EXPECT_TRUE(fails_with(read_text(head + "ASCII\nDATASET POLYDATA\nPOINTS 1 float\n1 2 z\n", "c.vtk"),
                         ErrorCode::kMalformed, "line 6: 'z'"));
}

TEST(Unsupported, SaysWhatToRunFirst) {
  const struct {
    std::string bytes;
    const char *name, *part;
  } kCases[] = {{"\x1f\x8b\x08 and so on", "map.pcd.gz", "gzip -dk"},
                {"\x89MCAP0\r\n", "a.mcap", "rosbags-convert"},
                {"PK\x03\x04zzzz", "a.ply", "zip"},
                {"BZh91AY", "a", "bzip2"},
                {"SQLite format 3", "a.db3", "rosbags-convert"},
                {"# Octomap OcTree binary file\n", "a.bt", "octree2pointcloud"},
                {"\x28\xb5\x2f\xfd...", "a.zst", "zstd"},
                {"\x1f\x8b\x08", "a.rawlog", "rawlog"}};
  for (const auto& c : kCases) {
    const auto r = read_text(c.bytes, c.name);
    EXPECT_TRUE(fails_with(r, ErrorCode::kUnsupported, c.part)) << message(r);
  }
}

TEST(Open, MissingFolderEmpty) {
  Folder folder;
  EXPECT_TRUE(
      fails_with(drain(open_source(folder / "none.pcd")), ErrorCode::kNotFound, "none.pcd: no such file"));
  EXPECT_TRUE(fails_with(drain(open_source(folder / "")), ErrorCode::kUnreadable, "is a directory"));
  write_bytes(folder / "empty.pcd", "");
  EXPECT_TRUE(fails_with(drain(open_source(folder / "empty.pcd")), ErrorCode::kEmpty, "is empty"));
  write_bytes(folder / "a.txt", "1 2 3\n");
  EXPECT_EQ(*detect_format(folder / "a.txt"), "XYZ");
  EXPECT_EQ(*input_bytes(folder / "a.txt"), 6u);
}

TEST(Open, ContentBeatsName) {
  const auto r = read_text(pcd_xyz(1, "1 2 3\n"), "scan.ply");
  EXPECT_TRUE(r.status.ok()) << message(r);
  EXPECT_EQ(r.cloud.size(), 1u);
}

TEST(ScanFolder, PosesAreApplied) {
  Folder folder;
  write_bytes(folder / "scan000.3d", "1 0 0\n");
  write_bytes(folder / "scan000.pose", "0 0 0\n0 0 0\n");
  write_bytes(folder / "scan001.3d", "1 0 0\n0 1 0\n");
  write_bytes(folder / "scan001.pose", "10 20 30\n0 0 90\n");
  const auto r = drain(open_source(folder / "", {.unit_m = 0.01}));
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 3u);
  EXPECT_NEAR(r.cloud.xyz[1][0], 0.10, 1e-12);
  EXPECT_NEAR(r.cloud.xyz[1][1], 0.21, 1e-12);
  EXPECT_NEAR(r.cloud.xyz[2][0], 0.09, 1e-12);
  EXPECT_EQ(*detect_format(folder / ""), "3DTK");
}

std::unique_ptr<PointSource> opened(const std::string& text, const char* name) {
  return std::move(open_source_memory(
                       ByteSpan(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), name))
      .value();
}
ReadBack read_both(const std::string& first, const std::string& second, bool every_channel = false) {
  std::vector<std::unique_ptr<PointSource>> sources;
  sources.push_back(opened(first, "first"));
  sources.push_back(opened(second, "second"));
  return drain(concatenate(std::move(sources), every_channel));
}

TEST(Concatenate, MatchesChannelsByName) {
  const std::string a = pcd("x y z ring t", "4 4 4 1 8", "F F F U F", 1, "ascii", "1 2 3 4 5\n");
  const std::string b = pcd("t x y z ring", "8 8 8 8 1", "F F F F U", 1, "ascii", "50 10 20 30.1 40\n");
  const std::string c = pcd_xyz(1, "7 8 9\n");
  const auto r = read_both(a, b);
  ASSERT_TRUE(r.status.ok()) << message(r);
  ASSERT_EQ(r.cloud.size(), 2u);
  EXPECT_EQ(r.cloud.coordinates.kind, Kind::f64);
  EXPECT_EQ(r.cloud.xyz[1][2], 30.1);
  EXPECT_EQ(r.cloud.find("ring")->get<std::uint8_t>(1), 40);
  EXPECT_EQ(r.cloud.find("t")->get<double>(1), 50);
  EXPECT_TRUE(fails_with(read_both(a, c), ErrorCode::kInvalidArgument,
                         "second: has no channel ring (u8), which first has"));
  EXPECT_TRUE(fails_with(read_both(c, a), ErrorCode::kInvalidArgument, "first: has no channel ring"));
  EXPECT_FALSE(concatenate({}).ok());
}

TEST(Concatenate, AlphaThatNotAllHaveIsDroppedAloud) {
  const std::string with = pcd("x y z rgb", "4 4 4 4", "F F F U", 1, "ascii", "1 2 3 4278321666\n");
  const std::string without =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n4 5 6 7 8 9\n";
  for (const bool swapped : {false, true}) {
    const auto r = swapped ? read_both(without, with) : read_both(with, without);
    ASSERT_TRUE(r.status.ok()) << message(r);
    ASSERT_EQ(r.cloud.size(), 2u);
    EXPECT_EQ(r.cloud.channels.size(), 1u);
    const Channel* rgb = r.cloud.find("rgb");
    ASSERT_NE(rgb, nullptr);
    EXPECT_EQ(rgb->get<std::uint8_t>(swapped ? 0 : 1, 2), 9);
    EXPECT_EQ(rgb->get<std::uint8_t>(swapped ? 1 : 0, 2), 4278321666u & 255);
    ASSERT_EQ(r.warnings.size(), 1u);
    EXPECT_NE(r.warnings[0].find(swapped ? "second: the fourth byte" : "first: the fourth byte"),
              std::string::npos)
        << r.warnings[0];
  }
  EXPECT_TRUE(fails_with(read_both(with, without, true), ErrorCode::kInvalidArgument,
                         "second: has no channel alpha (u8), which first has"));
  EXPECT_TRUE(fails_with(read_both(without, with, true), ErrorCode::kInvalidArgument,
                         "first: has no channel alpha (u8), which second has"));
  const auto both = read_both(with, with);
  EXPECT_NE(both.cloud.find("alpha"), nullptr);
  EXPECT_TRUE(both.warnings.empty());
}

}  // namespace
}  // namespace mapcodec
