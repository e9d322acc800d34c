// SPDX-License-Identifier: GPL-3.0-or-later
// Archives of one compiler's build for that of another (tests/fuzz/compare_builds):
//   map_exchange write FOLDER     every codec on a made-up room
//   map_exchange hash FOLDER...   what the archives there decode to, a line each
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <random>
#include <string>

#include "mapcodec/cloud/cloud_source.hpp"
#include "mapcodec/quality/multiset_hash.hpp"
#include "slam_adapter/compress.hpp"
#include "slam_adapter/map_file.hpp"

namespace {

using namespace mapcodec;

/// A floor, two walls and clutter, coloured.
PointCloud room(std::size_t count) {
  std::mt19937 random(11);
  const auto uniform = [&random] { return static_cast<double>(random()) / 4294967296.0; };
  PointCloud cloud;
  Channel rgb{{"rgb", ScalarType::u8, 3}, {}}, intensity{{"intensity", ScalarType::f32, 1}, {}};
  for (std::size_t i = 0; i < count; ++i) {
    Vec3 p{4 * uniform(), 3 * uniform(), 2 * uniform()};
    if (i % 10 != 0) p[i % 3] = 0.01 * (uniform() + uniform() - 1);
    for (double& v : p) v = static_cast<float>(v);
    cloud.xyz.push_back(p);
    for (const double v : p) rgb.data.push_back(static_cast<std::uint8_t>(60 * v + 9 * uniform()));
  }
  intensity.data.resize(count * intensity.info.stride());
  for (std::size_t i = 0; i < count; ++i) intensity.set<float>(i, static_cast<float>(uniform() * 100));
  cloud.channels = {std::move(rgb), std::move(intensity)};
  return cloud;
}

struct Case {
  const char* name;
  PromiseKind promise;
  double value;
  CodecChoice codecs;
  double tile_size_m;
  Effort effort = Effort::standard;
};
constexpr Case kCases[] = {
    {"surface_fine", PromiseKind::rms, 0.006, CodecChoice::surface, 0},
    {"surface", PromiseKind::rms, 0.02, CodecChoice::surface, 0},
    {"surface_high", PromiseKind::rms, 0.02, CodecChoice::surface, 0, Effort::high},
    {"surface_coarse", PromiseKind::rms, 0.08, CodecChoice::surface, 0},
    {"surface_tiles", PromiseKind::rms, 0.03, CodecChoice::surface, 1.5},
    {"mixed", PromiseKind::rms, 0.012, CodecChoice::cheapest, 1},
    {"points", PromiseKind::max_error, 0.005, CodecChoice::points, 0},
    {"points_high", PromiseKind::max_error, 0.02, CodecChoice::points, 1, Effort::high},
    {"lossless", PromiseKind::lossless, 0, CodecChoice::points, 0},
};

int write(const std::string& folder) {
  const PointCloud cloud = room(20000);
  for (const Case& c : kCases) {
    CompressOptions o;
    o.promise = c.promise;
    o.promise_m = c.value;
    o.codecs = c.codecs;
    o.tile_size_m = c.tile_size_m;
    o.effort = c.effort;
    o.color_error = 40;
    o.overwrite = true;
    CloudSource source(cloud);
    const auto report = compress(source, folder + "/" + c.name + ".mapc", o);
    if (!report.ok()) {
      std::fprintf(stderr, "map_exchange: %s: %s\n", c.name, report.error().to_string().c_str());
      return 1;
    }
  }
  return 0;
}

int hash(const std::string& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".mapc") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  for (const auto& path : paths) {
    const Result<MapFile> map = MapFile::open(path.string());
    const Result<PointCloud> cloud = map.ok() ? map->read() : Result<PointCloud>(map.error());
    const std::string what = cloud.ok() ? multiset_hash(*cloud).hex() : cloud.error().to_string();
    std::printf("%s %zu %s\n", path.string().c_str(), cloud.ok() ? cloud->size() : 0, what.c_str());
    if (!cloud.ok()) return 1;
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const std::string verb = argv[1];
  if (verb == "write") return write(argv[2]);
  for (int i = 2; verb == "hash" && i < argc; ++i) {
    if (const int failed = hash(argv[i]); failed != 0) return failed;
  }
  return verb == "hash" ? 0 : 2;
}
