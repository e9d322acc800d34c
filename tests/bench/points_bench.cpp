// SPDX-License-Identifier: GPL-3.0-or-later
// Bits and speed of the `points` codec on a cloud cut into cubes, with Draco's kd-tree on the same integers
// beside it.
//   points_bench cloud step_m [most_points_a_tile [repeats]]
// The cloud is a binary PCD whose fields begin with float x y z, or raw: a 64-bit count, then float32
// triples.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <string>

#include <time.h>

#ifdef MAPCODEC_BENCH_DRACO
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud_builder.h>
#endif

#include "mapcodec/codec/points_decoder.hpp"
#include "mapcodec/codec/points_encoder.hpp"

namespace {

using namespace mapcodec;
using Cloud = std::vector<Vec3>;

std::string read_file(const char* path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Value of a header line such as "POINTS 12".
std::string header_value(const std::string& bytes, const std::string& name) {
  const std::size_t at = bytes.find("\n" + name + " ");
  return at == std::string::npos
             ? ""
             : bytes.substr(at + name.size() + 2, bytes.find('\n', at + 1) - at - name.size() - 2);
}

std::size_t pcd_stride(const std::string& bytes) {
  std::size_t sum = 0;
  const std::string sizes = header_value(bytes, "SIZE");
  for (const char* s = sizes.c_str(); *s != 0;) {
    char* end = nullptr;
    sum += std::strtoul(s, &end, 10);
    s = *end == ' ' ? end + 1 : end + std::strlen(end);
  }
  return sum;
}

Cloud take_points(const char* data, std::size_t count, std::size_t stride) {
  Cloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    float f[3];
    std::memcpy(f, data + i * stride, 12);
    const Vec3 p{f[0], f[1], f[2]};
    if (is_finite(p)) cloud.push_back(p);
  }
  return cloud;
}

Cloud read_cloud(const char* path) {
  const std::string bytes = read_file(path);
  if (bytes.rfind("# .PCD", 0) == 0) {
    const std::size_t data = bytes.find("DATA binary\n") + 12;
    return take_points(bytes.data() + data, std::strtoul(header_value(bytes, "POINTS").c_str(), nullptr, 10),
                       pcd_stride(bytes));
  }
  std::uint64_t count = 0;
  std::memcpy(&count, bytes.data(), 8);
  return take_points(bytes.data() + 8, count, 12);
}

/// Cubes of `side` metres, halved until no tile has more than `most` points.
void cut(const Cloud& cloud, double side, std::size_t most, std::vector<Cloud>& tiles) {
  std::map<std::array<long, 3>, Cloud> cubes;
  for (const Vec3& p : cloud) {
    cubes[{std::lround(std::floor(p[0] / side)), std::lround(std::floor(p[1] / side)),
           std::lround(std::floor(p[2] / side))}]
        .push_back(p);
  }
  for (const auto& [key, tile] : cubes) {
    if (tile.size() > most && side > 0.01) {
      cut(tile, side / 2, most, tiles);
    } else {
      tiles.push_back(tile);
    }
  }
}

/// Seconds of this thread's CPU time: other programs on the machine disturb it least.
double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Figures {
  double bits = 0, encode_s = 1e30, decode_s = 1e30;
};
void print(const char* name, const Figures& f, std::size_t points, std::size_t tiles) {
  const double n = static_cast<double>(points);
  std::printf("%-8s tiles %4zu  bits/point %7.4f  encode %6.2f  decode %6.2f Mpoints/s\n", name, tiles,
              f.bits / n, n / f.encode_s / 1e6, n / f.decode_s / 1e6);
}

Figures run_points(const std::vector<Cloud>& tiles, const Quantizer& quantizer,
                   const PointsSettings& settings, int repeats) {
  Figures best;
  for (int r = 0; r < repeats; ++r) {
    Figures f{0, 0, 0};
    for (const Cloud& tile : tiles) {
      const double t0 = now();
      const auto encoded = encode_points(tile, quantizer, settings);
      const double t1 = now();
      if (!encoded || encoded->max_axis_error_m > quantizer.step_m * 0.51) std::abort();
      const double t2 = now();
      const auto decoded = decode_points(encoded->bytes, encoded->decoded.size(), quantizer, {});
      const double t3 = now();
      if (!decoded || decoded->xyz != encoded->decoded || decoded->voxels != encoded->voxels) std::abort();
      f.bits += 8.0 * static_cast<double>(encoded->bytes.size());
      f.encode_s += t1 - t0;
      f.decode_s += t3 - t2;
    }
    best.bits = f.bits;
    best.encode_s = std::min(best.encode_s, f.encode_s);
    best.decode_s = std::min(best.decode_s, f.decode_s);
  }
  return best;
}

#ifdef MAPCODEC_BENCH_DRACO
std::unique_ptr<draco::PointCloud> integers(const std::vector<std::array<std::int32_t, 3>>& cells) {
  draco::PointCloudBuilder builder;
  builder.Start(static_cast<draco::PointIndex::ValueType>(cells.size()));
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_INT32);
  for (std::uint32_t i = 0; i < cells.size(); ++i) {
    builder.SetAttributeValueForPoint(id, draco::PointIndex(i), cells[i].data());
  }
  return builder.Finalize(false);
}

/// Draco's fastest clock: quantised integers in, integers out, speed 0 (-cl 10), kd-tree.
Figures run_draco(const std::vector<Cloud>& tiles, const Quantizer& quantizer, int repeats) {
  Figures best;
  for (int r = 0; r < repeats; ++r) {
    Figures f{0, 0, 0};
    for (const Cloud& tile : tiles) {
      const double t0 = now();
      std::vector<std::array<std::int32_t, 3>> cells(tile.size());
      for (std::size_t i = 0; i < tile.size(); ++i) {
        for (std::size_t a = 0; a < 3; ++a)
          cells[i][a] = static_cast<std::int32_t>(quantizer.lattice(tile[i][a], a));
      }
      const auto cloud = integers(cells);
      draco::ExpertEncoder encoder(*cloud);
      encoder.SetSpeedOptions(0, 0);
      encoder.SetEncodingMethod(draco::POINT_CLOUD_KD_TREE_ENCODING);
      draco::EncoderBuffer out;
      if (!encoder.EncodeToBuffer(&out).ok()) std::abort();
      const double t1 = now();
      draco::DecoderBuffer in;
      in.Init(out.data(), out.size());
      draco::Decoder decoder;
      auto decoded = decoder.DecodePointCloudFromBuffer(&in);
      const double t2 = now();
      if (!decoded.ok() || decoded.value()->num_points() != tile.size()) std::abort();
      f.bits += 8.0 * static_cast<double>(out.size());
      f.encode_s += t1 - t0;
      f.decode_s += t2 - t1;
    }
    best.bits = f.bits;
    best.encode_s = std::min(best.encode_s, f.encode_s);
    best.decode_s = std::min(best.decode_s, f.decode_s);
  }
  return best;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: points_bench cloud step_m [most_points_a_tile [repeats]]\n");
    return 2;
  }
  const Cloud cloud = read_cloud(argv[1]);
  const std::size_t most = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 200000;
  const int repeats = argc > 4 ? std::atoi(argv[4]) : 3;
  std::vector<Cloud> tiles;
  cut(cloud, 1024, most, tiles);
  const Quantizer quantizer{{0, 0, 0}, std::atof(argv[2]), CoordinateFormat::Kind::f32};
  std::printf("%s: %zu points, step %s m\n", argv[1], cloud.size(), argv[2]);
  const std::pair<const char*, Effort> kEfforts[] = {
      {"fast", Effort::fast}, {"standard", Effort::standard}, {"high", Effort::high}};
  for (const auto& [name, effort] : kEfforts) {
    print(name, run_points(tiles, quantizer, {effort, true}, repeats), cloud.size(), tiles.size());
  }
  print("merged", run_points(tiles, quantizer, {Effort::standard, false}, 1), cloud.size(), tiles.size());
#ifdef MAPCODEC_BENCH_DRACO
  print("draco", run_draco(tiles, quantizer, repeats), cloud.size(), tiles.size());
#endif
  return 0;
}
