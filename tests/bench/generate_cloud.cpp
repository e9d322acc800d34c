// SPDX-License-Identifier: GPL-3.0-or-later
// generate_cloud OUT.pcd POINTS: a made-up building of 6 m rooms, scanned room after room, coloured, with 4
// mm noise. Any number of points in constant memory; the same arguments give the same file.
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "slam_adapter/formats/formats.hpp"

namespace {

using namespace mapcodec;

constexpr double kRoom = 6, kHeight = 3, kNoise = 0.004;
constexpr std::uint64_t kPointsPerRoom = 400000;

/// SplitMix64 (Steele, Lea, Flood 2014).
class Random {
 public:
  double uniform() { return double(bits() >> 11) * 0x1p-53; }
  double normal() {
    return std::sqrt(-2 * std::log(1 - uniform())) * std::cos(6.283185307179586 * uniform());
  }

 private:
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  std::uint64_t state_ = 1;
};

/// A point on one of the six faces of the unit room, face by area.
Vec3 on_wall(Random& random, int& face) {
  const double u = random.uniform(), v = random.uniform(), pick = random.uniform();
  if (pick < 0.25) return face = 0, Vec3{u * kRoom, v * kRoom, 0};
  if (pick < 0.5) return face = 1, Vec3{u * kRoom, v * kRoom, kHeight};
  face = 2 + int((pick - 0.5) * 8);
  if (face < 4) return {(face == 2 ? 0.1 : kRoom - 0.1), u * kRoom, v * kHeight};
  return {u * kRoom, (face == 4 ? 0.1 : kRoom - 0.1), v * kHeight};
}

void add_point(PointCloud& block, std::uint64_t index, std::uint64_t rooms_across, Random& random) {
  const std::uint64_t room = index / kPointsPerRoom;
  int face = 0;
  Vec3 p = on_wall(random, face);
  const double texture = std::sin(3 * p[0]) * std::cos(4 * p[1] + p[2]);
  p[0] += double(room % rooms_across) * kRoom;
  p[1] += double(room / rooms_across) * kRoom;
  const std::size_t i = block.size();
  block.resize(i + 1);
  for (std::size_t d = 0; d < 3; ++d) block.xyz[i][d] = double(float(p[d] + kNoise * random.normal()));
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = 90 + 20.0 * double((std::size_t(face) + c) % 6) + 40 * texture + 4 * random.normal();
    block.channels[0].set(i, std::uint8_t(std::fmin(255, std::fmax(0, value))), c);
  }
}

int fail(const Error& e) {
  std::fprintf(stderr, "generate_cloud: %s\n", e.to_string().c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: generate_cloud OUT.pcd POINTS\n");
    return 2;
  }
  const std::uint64_t count = std::strtoull(argv[2], nullptr, 10);
  const auto across = std::uint64_t(std::ceil(std::sqrt(double(count / kPointsPerRoom + 1))));
  PointCloud block;
  block.channels.push_back({{"rgb", ScalarType::u8, 3}, {}});
  auto sink = open_sink(argv[1], block, count);
  if (!sink.ok()) return fail(sink.error());
  Random random;
  for (std::uint64_t i = 0; i < count; ++i) {
    add_point(block, i, across, random);
    if (block.size() < 65536 && i + 1 < count) continue;
    if (const Status s = (*sink)->write(block); !s.ok()) return fail(s.error());
    block.resize(0);
  }
  const Status s = (*sink)->finish();
  return s.ok() ? 0 : fail(s.error());
}
