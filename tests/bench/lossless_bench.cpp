// SPDX-License-Identifier: GPL-3.0-or-later
// lossless_bench FILE TILE_M [VOXEL_M BOUND...]: codes a binary PCD file of float x y z and packed rgb (no
// other fields) in tiles, losslessly, and its colours over voxels within each bound; prints one JSON object
// per run. Times are processor seconds of one thread; every decoded number is compared.
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>

#include "mapcodec/attribute/channel_decoder.hpp"
#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/lossless_decoder.hpp"
#include "mapcodec/codec/lossless_encoder.hpp"
#include "mapcodec/geometry/morton.hpp"

namespace {

using namespace mapcodec;

struct Point {
  float x, y, z;
  std::uint8_t b, g, r, a;
};

struct Tile {
  std::vector<Vec3> xyz;
  Channel rgb{{"rgb", ScalarType::u8, 3}, {}};
};

struct Totals {
  std::size_t points = 0, bytes = 0, geometry = 0;
  double encode_s = 0, decode_s = 0, error = 0;
  bool same = true;
};

double seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

std::vector<Tile> read_tiles(const char* path, double side) {
  std::ifstream in(path, std::ios::binary);
  const std::string all((std::istreambuf_iterator<char>(in)), {});
  const std::size_t head = all.find("DATA binary\n");
  std::map<std::array<long, 3>, Tile> tiles;
  Point p;
  for (std::size_t at = head + 12; head != std::string::npos && at + sizeof p <= all.size(); at += sizeof p) {
    std::memcpy(&p, all.data() + at, sizeof p);
    const bool finite = std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    const auto key = [&](float v) { return finite ? static_cast<long>(std::floor(v / side)) : 0; };
    Tile& t = tiles[{key(p.x), key(p.y), key(p.z)}];
    t.xyz.push_back({p.x, p.y, p.z});
    t.rgb.data.insert(t.rgb.data.end(), {p.r, p.g, p.b});
  }
  std::vector<Tile> r;
  for (auto& [key, tile] : tiles) r.push_back(std::move(tile));
  return r;
}

Channel gather(const Channel& from, const std::vector<std::uint32_t>& order) {
  Channel to{from.info, {}};
  for (const std::uint32_t i : order) to.data.insert(to.data.end(), from.at(i), from.at(i) + 3);
  return to;
}

void code_lossless(const Tile& t, Totals& sum) {
  const ChannelSchema schema{t.rgb.info, ChannelKept::exact, 0, {}};
  const double start = seconds();
  const auto e = encode_lossless(t.xyz, {}, {0, 0, 0}, Effort::standard);
  const Channel rgb = gather(t.rgb, e->order);
  const auto c = encode_channel(schema, rgb, e->voxels, Effort::standard);
  const double middle = seconds();
  const auto d = decode_lossless(e->bytes, t.xyz.size(), {}, {0, 0, 0}, {});
  const auto colors = d ? decode_channel(c->bytes, schema, d->voxels, {}) : d.error();
  sum.decode_s += seconds() - middle;
  sum.encode_s += middle - start;
  sum.points += t.xyz.size();
  sum.geometry += e->bytes.size();
  sum.bytes += e->bytes.size() + c->bytes.size();
  sum.same = sum.same && colors.ok() && colors->data == rgb.data;
  for (std::size_t i = 0; sum.same && i < t.xyz.size(); ++i) {
    sum.same = std::memcmp(&d->xyz[i], &t.xyz[e->order[i]], sizeof(Vec3)) == 0;
  }
}

/// Indices in the Morton order of voxels of `step`, and the voxels.
std::vector<std::uint32_t> voxel_order(const Tile& t, double step, std::vector<VoxelCoord>& voxels) {
  Box box;
  for (const Vec3& p : t.xyz) box.add(p);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
  for (std::uint32_t i = 0; i < t.xyz.size(); ++i) {
    VoxelCoord v{};
    for (std::size_t d = 0; d < 3; ++d)
      v[d] = static_cast<std::uint32_t>(std::floor((t.xyz[i][d] - box.min[d]) / step));
    if (is_finite(t.xyz[i])) keys.emplace_back(morton_encode(v), i);
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order;
  for (const auto& [key, i] : keys) {
    voxels.push_back(morton_decode(key));
    order.push_back(i);
  }
  return order;
}

void code_color(const Tile& t, double step, double bound, Totals& sum) {
  std::vector<VoxelCoord> voxels;
  const Channel rgb = gather(t.rgb, voxel_order(t, step, voxels));
  const ChannelSchema schema{rgb.info, ChannelKept::bounded, bound, {}};
  const double start = seconds();
  const auto e = encode_channel(schema, rgb, voxels, Effort::standard);
  const double middle = seconds();
  const auto d = decode_channel(e->bytes, schema, voxels, {});
  sum.decode_s += seconds() - middle;
  sum.encode_s += middle - start;
  sum.points += voxels.size();
  sum.bytes += e->bytes.size();
  sum.error += e->error * static_cast<double>(voxels.size());
  sum.same = sum.same && d.ok() && d->data == e->decoded.data;
}

void print(const std::string& what, const Totals& t) {
  const auto n = static_cast<double>(t.points);
  std::cout << "{\"what\": \"" << what << "\", \"points\": " << t.points << ", \"bytes\": " << t.bytes
            << ", \"bits\": " << 8 * static_cast<double>(t.bytes) / n
            << ", \"geometry_bits\": " << 8 * static_cast<double>(t.geometry) / n
            << ", \"error\": " << t.error / n << ", \"encode_Mps\": " << n / t.encode_s / 1e6
            << ", \"decode_Mps\": " << n / t.decode_s / 1e6
            << ", \"decoded\": " << (t.same ? "true" : "false") << "}\n";
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::cerr << "usage: lossless_bench FILE TILE_M [VOXEL_M BOUND...]\n";
    return 2;
  }
  const std::vector<Tile> tiles = read_tiles(argv[1], std::atof(argv[2]));
  Totals lossless;
  for (const Tile& t : tiles) code_lossless(t, lossless);
  print("lossless", lossless);
  for (int i = 4; i < argc; ++i) {
    Totals color;
    for (const Tile& t : tiles) code_color(t, std::atof(argv[3]), std::atof(argv[i]), color);
    print(std::string("colour within ") + argv[i], color);
  }
  return lossless.same ? 0 : 1;
}
