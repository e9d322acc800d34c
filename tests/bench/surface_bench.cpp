// SPDX-License-Identifier: GPL-3.0-or-later
// Speed of the `surface` codec by stages, on a cloud cut into cubes, with Draco's kd-tree at the same RMS
// beside it: processor time of one thread, best of the repeats.
//   surface_bench cloud spacings[@step_m][,...] [most_points_a_tile [repeats]]
// `spacings`: the RMS in mean distances of neighbours; the step that gives it is searched, unless it is
// given.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <time.h>

#ifdef MAPCODEC_BENCH_DRACO
#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud_builder.h>
#endif

#include "mapcodec/codec/surface_decoder.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/grid_nearest.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/log_secant.hpp"
#include "slam_adapter/tile_sample.hpp"

namespace {

using namespace mapcodec;
using Cloud = std::vector<Vec3>;

/// Seconds of this thread's CPU time: other programs on the machine disturb it least.
double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double lap(double& from) {
  const double at = now(), seconds = at - from;
  from = at;
  return seconds;
}

Cloud read_cloud(const char* path) {
  ReadOptions options;
  const Result<std::string> format = detect_format(path);
  if (format.ok() && *format == "3DTK") options.unit_m = 0.01;
  auto source = open_source(path, options);
  Cloud cloud;
  if (!source.ok()) return cloud;
  for (PointCloud block;;) {
    const Result<bool> more = (*source)->next(block);
    if (!more.ok() || !*more) return cloud;
    for (const Vec3& p : block.xyz) {
      if (is_finite(p)) cloud.push_back(p);
    }
  }
}

/// Halves of the longer side, until no tile has more than `most` points.
void cut(Cloud cloud, std::size_t most, std::vector<Cloud>& tiles) {
  if (cloud.size() <= most) {
    tiles.push_back(std::move(cloud));
    return;
  }
  Box box;
  for (const Vec3& p : cloud) box.add(p);
  std::size_t axis = 0;
  for (std::size_t d = 1; d < 3; ++d) {
    if (box.max[d] - box.min[d] > box.max[axis] - box.min[axis]) axis = d;
  }
  const double middle = (box.min[axis] + box.max[axis]) / 2;
  Cloud low, high;
  for (const Vec3& p : cloud) (p[axis] < middle ? low : high).push_back(p);
  cut(std::move(low), most, tiles);
  cut(std::move(high), most, tiles);
}

struct Figures {
  double bits = 0, forth = 0, back = 0, encode_s = 0, error_s = 0, density_s = 0, decode_s = 0;
  [[nodiscard]] double rms(double n) const { return std::sqrt(std::max(forth, back) / n); }
  void take_faster(const Figures& f) {
    encode_s = std::min(encode_s, f.encode_s);
    error_s = std::min(error_s, f.error_s);
    density_s = std::min(density_s, f.density_s);
    decode_s = std::min(decode_s, f.decode_s);
  }
};

double sum(const std::vector<double>& values) {
  double s = 0;
  for (const double v : values) s += v;
  return s;
}

Figures run_surface(const std::vector<Cloud>& tiles, double step_m) {
  const Quantizer lattice{{0, 0, 0}, step_m, CoordinateFormat::Kind::f32};
  Figures f;
  for (const Cloud& tile : tiles) {
    double at = now();
    const auto encoded = encode_surface(tile, lattice, {});
    if (!encoded.ok()) std::abort();
    f.encode_s += lap(at);
    const NearestPair near = find_nearest_pair(tile, encoded->decoded);
    f.error_s += lap(at);
    if (!(density_error(tile, encoded->decoded) >= 0)) std::abort();
    f.density_s += lap(at);
    const auto decoded = decode_surface(encoded->bytes, tile.size(), lattice, {});
    if (!decoded.ok() || decoded->xyz.size() != tile.size()) std::abort();
    f.decode_s += lap(at);
    f.forth += sum(near.forth.squared);
    f.back += sum(near.back.squared);
    f.bits += 8.0 * static_cast<double>(encoded->bytes.size());
  }
  return f;
}

/// The step at which the RMS is what was asked for, within 3 %.
double find_step(const std::vector<Cloud>& tiles, double n, double rms_m) {
  LogSecant secant(rms_m, 0.6);
  double step = rms_m;
  for (int i = 0; i < 8; ++i) {
    const double rms = run_surface(tiles, step).rms(n);
    if (std::abs(rms / rms_m - 1) < 0.03) break;
    step = secant.next(step, rms);
  }
  return step;
}

#ifdef MAPCODEC_BENCH_DRACO
/// Draco's fastest clock: quantised integers in, speed 0 (-cl 10), kd-tree.
double run_draco(const std::vector<Cloud>& tiles, double step_m, double& bits) {
  const Quantizer quantizer{{0, 0, 0}, step_m, CoordinateFormat::Kind::f32};
  double seconds = 0;
  bits = 0;
  for (const Cloud& tile : tiles) {
    double at = now();
    draco::PointCloudBuilder builder;
    builder.Start(static_cast<draco::PointIndex::ValueType>(tile.size()));
    const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_INT32);
    for (std::uint32_t i = 0; i < tile.size(); ++i) {
      std::array<std::int32_t, 3> cell{};
      for (std::size_t a = 0; a < 3; ++a)
        cell[a] = static_cast<std::int32_t>(quantizer.lattice(tile[i][a], a));
      builder.SetAttributeValueForPoint(id, draco::PointIndex(i), cell.data());
    }
    const auto cloud = builder.Finalize(false);
    draco::ExpertEncoder encoder(*cloud);
    encoder.SetSpeedOptions(0, 0);
    encoder.SetEncodingMethod(draco::POINT_CLOUD_KD_TREE_ENCODING);
    draco::EncoderBuffer out;
    if (!encoder.EncodeToBuffer(&out).ok()) std::abort();
    seconds += lap(at);
    bits += 8.0 * static_cast<double>(out.size());
  }
  return seconds;
}
#endif

void report(const std::vector<Cloud>& tiles, double n, double spacing, double spacings, double step_m,
            int repeats) {
  const double step = step_m > 0 ? step_m : find_step(tiles, n, spacings * spacing);
  Figures best = run_surface(tiles, step);
  for (int r = 1; r < repeats; ++r) best.take_faster(run_surface(tiles, step));
  const double rms = best.rms(n);
  std::printf(
      "  %.2f spacings, step %.6g m, RMS %.4g mm, %.4f bits: ns a point: encode %.0f, errors %.0f, density "
      "%.0f, decode %.0f; Mpoints/s: encode %.3f, with errors %.3f, decode %.2f",
      rms / spacing, step, rms * 1e3, best.bits / n, 1e9 * best.encode_s / n, 1e9 * best.error_s / n,
      1e9 * best.density_s / n, 1e9 * best.decode_s / n, n / best.encode_s / 1e6,
      n / (best.encode_s + best.error_s + best.density_s) / 1e6, n / best.decode_s / 1e6);
#ifdef MAPCODEC_BENCH_DRACO
  // Rounding to a grid loses half its step.
  double bits = 0, seconds = 1e30;
  for (int r = 0; r < repeats; ++r) seconds = std::min(seconds, run_draco(tiles, 2 * rms, bits));
  std::printf("; Draco %.2f Mpoints/s, %.3f bits, encode ratio %.3f", n / seconds / 1e6, bits / n,
              seconds / best.encode_s);
#endif
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr,
                 "usage: surface_bench cloud spacings[@step_m][,...] [most_points_a_tile [repeats]]\n");
    return 2;
  }
  Cloud cloud = read_cloud(argv[1]);
  if (cloud.empty()) return 1;
  const auto n = static_cast<double>(cloud.size());
  const double spacing = mean_spacing(cloud);
  std::vector<Cloud> tiles;
  cut(std::move(cloud), argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 600000, tiles);
  std::printf("%s: %.0f points %.4g mm apart, %zu tiles\n", argv[1], n, spacing * 1e3, tiles.size());
  const int repeats = argc > 4 ? std::max(1, std::atoi(argv[4])) : 1;
  for (char* s = argv[2]; *s != 0;) {
    const double spacings = std::strtod(s, &s);
    double step = 0;
    if (*s == '@') step = std::strtod(s + 1, &s);
    report(tiles, n, spacing, spacings, step, repeats);
    if (*s != ',') break;
    ++s;
  }
  return 0;
}
