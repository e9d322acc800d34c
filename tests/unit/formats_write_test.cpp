// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <random>

#include "slam_adapter/formats/lzf.hpp"
#include "tests/unit/formats_support.hpp"

namespace mapcodec {
namespace {

using namespace formats_test;
using Kind = CoordinateFormat::Kind;

/// Points about `origin` with channels of random bits (finite floats).
PointCloud make_cloud(const CoordinateFormat& format, const std::vector<ChannelInfo>& channels,
                      std::size_t count, double origin = 0) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> unit(-50, 50);
  PointCloud c;
  c.coordinates = format;
  for (const ChannelInfo& i : channels) c.channels.push_back({i, {}});
  c.resize(count);
  for (Vec3& p : c.xyz) {
    for (std::size_t d = 0; d < 3; ++d) {
      p[d] = (format.kind == Kind::fixed ? format.offset[d] : origin) + unit(random);
      if (format.kind == Kind::f32) p[d] = float(p[d]);
      if (format.kind == Kind::fixed)
        p[d] = std::round((p[d] - format.offset[d]) / format.scale[d]) * format.scale[d] + format.offset[d];
    }
  }
  for (Channel& ch : c.channels) {
    for (std::uint8_t& b : ch.data) b = static_cast<std::uint8_t>(random());
    for (std::size_t i = 0; i < count * ch.info.components; ++i) {
      if (ch.info.scalar == ScalarType::f32) ch.set<float>(0, float(unit(random)), i);
      if (ch.info.scalar == ScalarType::f64) ch.set<double>(0, unit(random), i);
    }
  }
  return c;
}

void expect_same(const PointCloud& a, const PointCloud& b, Kind kind) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(b.coordinates.kind, kind);
  EXPECT_TRUE(a.xyz == b.xyz);
  for (const Channel& c : a.channels) {
    const Channel* other = b.find(c.info.name);
    ASSERT_NE(other, nullptr) << c.info.name;
    EXPECT_EQ(other->info.type_name(), c.info.type_name()) << c.info.name;
    EXPECT_TRUE(other->data == c.data) << c.info.name;
  }
  EXPECT_EQ(a.channels.size(), b.channels.size());
}

const CoordinateFormat kF32{}, kF64{Kind::f64, {1, 1, 1}, {0, 0, 0}},
    kFixed{Kind::fixed, {0.001, 0.001, 0.01}, {500000, 4000000, 0}};
const std::vector<ChannelInfo> kMany = {{"rgb", ScalarType::u8, 3},     {"alpha", ScalarType::u8, 1},
                                        {"normal", ScalarType::f32, 3}, {"intensity", ScalarType::f32, 1},
                                        {"ring", ScalarType::u16, 1},   {"t", ScalarType::f64, 1},
                                        {"label", ScalarType::i32, 1}};

TEST(RoundTrip, AllFormatsWithTypedChannels) {
  Folder folder;
  const struct {
    const char* name;
    WriteOptions options;
  } kFiles[] = {{"a.pcd", {}}, {"b.pcd", {.ascii = true}}, {"c.pcd", {.compressed = true}},
                {"d.ply", {}}, {"e.ply", {.ascii = true}}, {"f.xyz", {}},
                {"g.vtk", {}}};
  for (const auto& f : kFiles) {
    for (const CoordinateFormat& format : {kF32, kF64, kFixed}) {
      SCOPED_TRACE(std::string(f.name) + " " + std::to_string(int(format.kind)));
      const PointCloud cloud = make_cloud(format, kMany, 1000, 1e6);
      EXPECT_TRUE(unwritten_channels(folder / f.name, cloud.like()).empty());
      const Status s = write_cloud(folder / f.name, cloud, f.options, 300);
      ASSERT_TRUE(s.ok()) << s.error().to_string();
      const auto back = drain(open_source(folder / f.name));
      ASSERT_TRUE(back.status.ok()) << message(back);
      expect_same(cloud, back.cloud, format.kind == Kind::f32 ? Kind::f32 : Kind::f64);
    }
  }
}

TEST(RoundTrip, NormalsOfDoubles) {
  Folder folder;
  for (const char* name : {"a.pcd", "a.ply", "a.vtk", "a.xyz"}) {
    SCOPED_TRACE(name);
    const PointCloud cloud = make_cloud(kF64, {{"normal", ScalarType::f64, 3}}, 200, 10);
    EXPECT_TRUE(unwritten_channels(folder / name, cloud.like()).empty());
    ASSERT_TRUE(write_cloud(folder / name, cloud).ok());
    const auto back = drain(open_source(folder / name));
    ASSERT_TRUE(back.status.ok()) << message(back);
    expect_same(cloud, back.cloud, Kind::f64);
  }
}

TEST(RoundTrip, OnePointAndNoChannel) {
  Folder folder;
  for (const char* name : {"a.pcd", "a.ply", "a.las", "a.xyz", "a.txt", "a.pts", "a.bin", "a.vtk"}) {
    const PointCloud cloud = make_cloud(kF64, {}, 1);
    ASSERT_TRUE(write_cloud(folder / name, cloud).ok()) << name;
    const auto back = drain(open_source(folder / name));
    ASSERT_TRUE(back.status.ok()) << message(back);
    ASSERT_EQ(back.cloud.size(), 1u);
    EXPECT_NEAR(back.cloud.xyz[0][1], cloud.xyz[0][1], 1e-4) << name;
  }
}

TEST(RoundTrip, PtsAndKitti) {
  Folder folder;
  const PointCloud pts =
      make_cloud(kF64, {{"intensity", ScalarType::f32, 1}, {"rgb", ScalarType::u8, 3}}, 500, 1e6);
  ASSERT_TRUE(write_cloud(folder / "a.pts", pts).ok());
  expect_same(pts, drain(open_source(folder / "a.pts")).cloud, Kind::f64);
  const PointCloud bin = make_cloud(kF32, {{"intensity", ScalarType::f32, 1}}, 500);
  ASSERT_TRUE(write_cloud(folder / "a.bin", bin).ok());
  expect_same(bin, drain(open_source(folder / "a.bin")).cloud, Kind::f32);
  const PointCloud ints =
      make_cloud(kF32, {{"intensity", ScalarType::u16, 1}, {"ring", ScalarType::u8, 1}}, 2);
  EXPECT_EQ(unwritten_channels("a.bin", ints.like()).size(), 2u);
  ASSERT_TRUE(write_cloud(folder / "b.bin", ints).ok());
  EXPECT_EQ(drain(open_source(folder / "b.bin")).cloud.channels[0].get<float>(1),
            float(ints.channels[0].get<std::uint16_t>(1)));
}

/// What a reader of LAS gives, with random bits within each field's width.
PointCloud las_cloud(bool wide, bool rgb, std::size_t extra) {
  std::vector<ChannelInfo> channels = {{"intensity", ScalarType::u16, 1},
                                       {"return_number", ScalarType::u8, 1},
                                       {"number_of_returns", ScalarType::u8, 1}};
  if (wide) channels.push_back({"class_flags", ScalarType::u8, 1});
  if (wide) channels.push_back({"scanner_channel", ScalarType::u8, 1});
  channels.push_back({"scan_flags", ScalarType::u8, 1});
  channels.push_back({"classification", ScalarType::u8, 1});
  if (!wide) channels.push_back({"class_flags", ScalarType::u8, 1});
  if (!wide) channels.push_back({"scan_angle", ScalarType::i8, 1});
  channels.push_back({"user_data", ScalarType::u8, 1});
  if (wide) channels.push_back({"scan_angle", ScalarType::i16, 1});
  channels.push_back({"point_source_id", ScalarType::u16, 1});
  channels.push_back({"gps_time", ScalarType::f64, 1});
  if (rgb) channels.push_back({"rgb", ScalarType::u16, 3});
  if (rgb && wide) channels.push_back({"nir", ScalarType::u16, 1});
  if (extra > 0) channels.push_back({"extra_bytes", ScalarType::u8, static_cast<std::uint8_t>(extra)});
  PointCloud c = make_cloud(kFixed, channels, 700, 500000);
  const auto limit = [&](const char* name, std::uint8_t mask) {
    Channel* ch = c.find(name);
    if (ch == nullptr) return;
    for (std::uint8_t& b : ch->data) b &= mask;
  };
  limit("return_number", wide ? 15 : 7);
  limit("number_of_returns", wide ? 15 : 7);
  limit("scan_flags", 3);
  limit("scanner_channel", 3);
  limit("class_flags", wide ? 15 : 7);
  if (!wide) limit("classification", 31);
  return c;
}

TEST(RoundTrip, LasKeepsEveryBit) {
  Folder folder;
  for (const bool wide : {false, true}) {
    for (const bool rgb : {false, true}) {
      const PointCloud cloud = las_cloud(wide, rgb, rgb ? 5 : 0);
      EXPECT_TRUE(unwritten_channels("a.las", cloud.like()).empty());
      const Status s = write_cloud(folder / "a.las", cloud, {}, 256);
      ASSERT_TRUE(s.ok()) << s.error().to_string();
      const auto back = drain(open_source(folder / "a.las"));
      ASSERT_TRUE(back.status.ok()) << message(back);
      expect_same(cloud, back.cloud, Kind::fixed);
      EXPECT_EQ(back.cloud.coordinates, cloud.coordinates);
    }
  }
}

TEST(RoundTrip, LasFromFloats) {
  Folder folder;
  const PointCloud cloud =
      make_cloud(kF64, {{"rgb", ScalarType::u8, 3}, {"intensity", ScalarType::f32, 1}}, 100, 3e6);
  EXPECT_EQ(unwritten_channels("a.las", cloud.like()).size(), 3u);
  ASSERT_TRUE(write_cloud(folder / "a.las", cloud).ok());
  const auto back = drain(open_source(folder / "a.las"));
  ASSERT_TRUE(back.status.ok()) << message(back);
  for (std::size_t i = 0; i < 100; ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      EXPECT_NEAR(back.cloud.xyz[i][d], cloud.xyz[i][d], 0.5001e-4);
      EXPECT_EQ(back.cloud.find("rgb")->get<std::uint16_t>(i, d),
                cloud.channels[0].get<std::uint8_t>(i, d) * 257);
    }
  }
}

TEST(LasWrite, RefusesWhatDoesNotFit) {
  Folder folder;
  PointCloud cloud = make_cloud(kFixed, {}, 2);
  cloud.xyz[1][0] = 1e9;
  const Status s = write_cloud(folder / "a.las", cloud);
  ASSERT_FALSE(s.ok());
  EXPECT_EQ(s.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(folder.files(), 0u);
}

TEST(PcdWrite, AlphaSurvivesAsText) {
  Folder folder;
  PointCloud cloud = make_cloud(kF32, {{"rgb", ScalarType::u8, 3}, {"alpha", ScalarType::u8, 1}}, 256);
  for (std::size_t i = 0; i < 256; ++i)
    cloud.channels[1].data[i] = static_cast<std::uint8_t>(i);  // 127 and 255 make NaN of a float
  for (const WriteOptions o : {WriteOptions{.ascii = true}, WriteOptions{}}) {
    ASSERT_TRUE(write_cloud(folder / "a.pcd", cloud, o).ok());
    expect_same(cloud, drain(open_source(folder / "a.pcd")).cloud, Kind::f32);
  }
}

TEST(Sink, LeavesNothingWithoutFinish) {
  Folder folder;
  const PointCloud cloud = make_cloud(kF32, {}, 10);
  write_bytes(folder / "a.pcd", "old");
  {
    auto sink = open_sink(folder / "a.pcd", cloud.like(), 10);
    ASSERT_TRUE(sink.ok());
    ASSERT_TRUE((*sink)->write(cloud).ok());
  }
  EXPECT_EQ(folder.files(), 1u);
  EXPECT_EQ(file_bytes(folder / "a.pcd"), "old");
}

TEST(Sink, RefusesAnotherCount) {
  Folder folder;
  const PointCloud cloud = make_cloud(kF32, {}, 10);
  for (const std::uint64_t announced : {9, 11}) {
    auto sink = open_sink(folder / "a.pcd", cloud.like(), announced);
    ASSERT_TRUE(sink.ok());
    Status s = (*sink)->write(cloud);
    if (s.ok()) s = (*sink)->finish();
    ASSERT_FALSE(s.ok());
    EXPECT_EQ(s.error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(folder.files(), 0u);
}

TEST(Sink, SaysWhyItCannotWrite) {
  Folder folder;
  const PointCloud layout = make_cloud(kF32, {}, 1).like();
  const auto code = [&](const std::string& path, const WriteOptions& o = {}) {
    const auto r = open_sink(path, layout, 1, o);
    return r.ok() ? ErrorCode::kUnreachable : r.error().code;
  };
  EXPECT_EQ(code(folder / "no/such/folder.pcd"), ErrorCode::kCannotWrite);
  EXPECT_EQ(code(folder / "a.unknown"), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(folder / "a.las", {.ascii = true}), ErrorCode::kInvalidArgument);
  EXPECT_EQ(code(folder / "a.ply", {.compressed = true}), ErrorCode::kInvalidArgument);
  std::filesystem::create_directory(folder / "dir.pcd");
  EXPECT_EQ(code(folder / "dir.pcd"), ErrorCode::kCannotWrite);
  std::filesystem::create_symlink("/dev/null", folder / "null.pcd");
  EXPECT_EQ(code(folder / "null.pcd"), ErrorCode::kCannotWrite);
}

TEST(Sink, FullDiskIsAnErrorThatNamesThePath) {
  Folder folder;
  const PointCloud cloud = make_cloud(kF32, kMany, 50000);
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{100000, before.rlim_max};
  for (const char* name : {"a.pcd", "a.ply", "a.las", "a.xyz", "a.pts", "a.bin", "a.vtk"}) {
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    const Status s = write_cloud(folder / name, cloud);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    ASSERT_FALSE(s.ok()) << name;
    EXPECT_EQ(s.error().code, ErrorCode::kCannotWrite);
    EXPECT_NE(s.error().message.find(name), std::string::npos) << s.error().message;
    EXPECT_EQ(folder.files(), 0u);
  }
}

TEST(Sink, SameBytesTwice) {
  Folder folder;
  const PointCloud cloud = make_cloud(kF64, kMany, 1000);
  for (const char* extension : {".pcd", ".ply", ".las", ".vtk", ".xyz"}) {
    ASSERT_TRUE(write_cloud(folder / (std::string("a") + extension), cloud, {}, 1000).ok());
    ASSERT_TRUE(write_cloud(folder / (std::string("b") + extension), cloud, {}, 77).ok());
    EXPECT_EQ(file_bytes(folder / (std::string("a") + extension)),
              file_bytes(folder / (std::string("b") + extension)))
        << extension;
  }
}

TEST(Lzf, RoundTripsAnything) {
  std::mt19937 random(3);
  for (std::size_t size : {0, 1, 2, 3, 4, 31, 32, 33, 264, 265, 1000, 9000, 100000}) {
    for (const unsigned mask : {0u, 1u, 3u, 255u}) {
      Bytes in(size);
      for (std::uint8_t& b : in) b = static_cast<std::uint8_t>(random() & mask);
      const Bytes packed = lzf_encode(in);
      EXPECT_LE(packed.size(), in.size() + in.size() / 32 + 1);
      EXPECT_LE(in.size(), packed.size() * kLzfMaxRatio);
      Bytes out(size);
      ASSERT_TRUE(lzf_decode(packed, out));
      EXPECT_TRUE(in == out);
      if (size == 0) continue;
      out.pop_back();
      EXPECT_FALSE(lzf_decode(packed, out));
    }
  }
}

TEST(Corruption, CutsAndFlipsNeverCrash) {
  Folder folder;
  const PointCloud cloud =
      make_cloud(kFixed, {{"rgb", ScalarType::u8, 3}, {"intensity", ScalarType::u16, 1}}, 12);
  const struct {
    const char* name;
    WriteOptions options;
  } kFiles[] = {{"a.pcd", {}},
                {"b.pcd", {.ascii = true}},
                {"c.pcd", {.compressed = true}},
                {"d.ply", {}},
                {"e.ply", {.ascii = true}},
                {"f.xyz", {}},
                {"g.vtk", {}},
                {"h.las", {}},
                {"i.pts", {}},
                {"j.bin", {}}};
  for (const auto& f : kFiles) {
    ASSERT_TRUE(write_cloud(folder / f.name, cloud, f.options).ok());
    const std::string bytes = file_bytes(folder / f.name);
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      const auto cut = read_text(bytes.substr(0, n), f.name);
      EXPECT_TRUE(!cut.status.ok() || cut.cloud.size() <= 12) << f.name << " cut at " << n;
      for (const int bit : {0, 3, 7}) {
        std::string bad = bytes;
        bad[n] = static_cast<char>(bad[n] ^ (1 << bit));
        const auto r = read_text(bad, f.name);
        EXPECT_LE(r.cloud.size(), 100u) << f.name << " flipped at " << n;
      }
    }
  }
}

/// Binary formats that announce their count must notice each lost byte.
TEST(Corruption, BinaryCutsAreErrors) {
  Folder folder;
  const PointCloud cloud = make_cloud(kF32, {{"intensity", ScalarType::f32, 1}}, 12);
  for (const char* name : {"a.pcd", "b.ply", "c.las"}) {
    ASSERT_TRUE(write_cloud(folder / name, cloud).ok());
    const std::string bytes = file_bytes(folder / name);
    for (std::size_t n = 0; n < bytes.size(); ++n)
      EXPECT_FALSE(read_text(bytes.substr(0, n), name).status.ok()) << name << " cut at " << n;
    EXPECT_FALSE(read_text(bytes + "x", name).status.ok()) << name;
  }
}

}  // namespace
}  // namespace mapcodec
