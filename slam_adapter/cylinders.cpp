// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/cylinders.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "slam_adapter/cylinders_ransac.hpp"

namespace mapcodec {

#ifdef MAPCODEC_CYLINDERS
namespace {

constexpr std::size_t kMostSamples = 150000;
constexpr std::size_t kMostOfOne = 400;  // samples of one patch

/// Oriented points spread over the patches by area.
struct Samples {
  std::vector<Vec3> points, normals;
  std::vector<std::uint32_t> patch;
  std::vector<std::uint32_t> first;  // of each patch, and one more
  double spacing_m = 0;
};

/// @return `count` points over the polygon: triangle by triangle on a lattice that fills evenly [Roberts].
void sample(const SurfacePatch& p, std::size_t count, std::vector<Vec3>& out) {
  const Vec3& a = p.polygon[0];
  double area = 0;
  std::size_t done = 0;
  for (std::size_t i = 1; i + 1 < p.polygon.size(); ++i) {
    const Vec3 u = minus(p.polygon[i], a), v = minus(p.polygon[i + 1], a), n = cross(u, v);
    area += std::sqrt(dot(n, n)) / 2;
    const auto upto = static_cast<std::size_t>(std::lround(std::min(1.0, area / p.area_m2) * double(count)));
    for (; done < upto; ++done) {
      double s = std::fmod(0.5 + 0.7548776662466927 * double(done), 1.0);
      double t = std::fmod(0.5 + 0.5698402909980532 * double(done), 1.0);
      if (s + t > 1) {
        s = 1 - s;
        t = 1 - t;
      }
      out.push_back({a[0] + s * u[0] + t * v[0], a[1] + s * u[1] + t * v[1], a[2] + s * u[2] + t * v[2]});
    }
  }
}

std::size_t samples_of(const SurfacePatch& p, double spacing) {
  return std::clamp<std::size_t>(static_cast<std::size_t>(p.area_m2 / (spacing * spacing)), 1, kMostOfOne);
}

Samples sample_all(std::span<const SurfacePatch> patches, double tolerance) {
  Samples s;
  s.spacing_m = 2 * tolerance;
  const auto total = [&] {
    std::size_t n = 0;
    for (const SurfacePatch& p : patches) n += samples_of(p, s.spacing_m);
    return n;
  };
  while (total() > kMostSamples && total() > 2 * patches.size()) s.spacing_m *= 1.25;
  for (std::uint32_t i = 0; i < patches.size(); ++i) {
    s.first.push_back(static_cast<std::uint32_t>(s.points.size()));
    sample(patches[i], samples_of(patches[i], s.spacing_m), s.points);
    s.normals.resize(s.points.size(), patches[i].normal);
    s.patch.resize(s.points.size(), i);
  }
  s.first.push_back(static_cast<std::uint32_t>(s.points.size()));
  return s;
}

double distance_to_axis(const RansacCylinder& c, const Vec3& p) {
  const Vec3 d = minus(p, c.on_axis);
  const double along = dot(d, c.axis);
  return std::sqrt(std::max(0.0, dot(d, d) - along * along));
}

/// Works out which of the found cylinders are better than the planes.
class Chooser {
 public:
  Chooser(std::span<const SurfacePatch> patches, std::span<const MapPlane> planes, const Samples& samples,
          const CylinderSettings& settings)
      : patches_(patches), planes_(planes), samples_(samples), settings_(settings) {
    plane_of_.assign(patches.size(), -1);
    for (std::size_t i = 0; i < planes.size(); ++i) {
      for (const std::uint32_t p : planes[i].patches) plane_of_[p] = static_cast<std::int32_t>(i);
    }
  }

  /// @return false if the planes are better.
  bool choose(RansacCylinder found, MapCylinder& out) const {
    out.patches = patches_on(found);
    if (out.patches.empty()) return false;
    refit(found, out.patches);
    measure(found, out);
    if (out.points < settings_.least_points || !(out.radius_m <= settings_.most_radius_m)) return false;
    if (out.arc_rad < settings_.least_arc_rad || out.planes < 2) return false;
    const bool nearer = out.rms_m <= out.planes_rms_m;
    const bool fewer =
        out.planes >= 3 && out.rms_m <= 1.25 * std::max(out.planes_rms_m, settings_.tolerance_m / 2);
    return nearer || fewer;
  }

 private:
  /// Patches that lie on it with most of their samples.
  [[nodiscard]] std::vector<std::uint32_t> patches_on(const RansacCylinder& c) const {
    std::vector<std::uint32_t> count(patches_.size(), 0), on;
    for (const std::uint32_t i : c.points) ++count[samples_.patch[i]];
    for (std::uint32_t p = 0; p < patches_.size(); ++p) {
      if (5 * count[p] > 3 * (samples_.first[p + 1] - samples_.first[p])) on.push_back(p);
    }
    return on;
  }

  /// Calls f(sample, weight): the points of a patch are shared among its samples.
  template <class F>
  void for_samples(const std::vector<std::uint32_t>& patches, F&& f) const {
    for (const std::uint32_t p : patches) {
      const double w = double(patches_[p].points) / double(samples_.first[p + 1] - samples_.first[p]);
      for (std::uint32_t i = samples_.first[p]; i < samples_.first[p + 1]; ++i) f(i, w);
    }
  }

  void refit(RansacCylinder& c, const std::vector<std::uint32_t>& on) const {
    double sum = 0, weight = 0;
    for_samples(on, [&](std::uint32_t i, double w) {
      sum += w * distance_to_axis(c, samples_.points[i]);
      weight += w;
    });
    if (weight > 0) c.radius_m = sum / weight;
  }

  void measure(const RansacCylinder& c, MapCylinder& out) const {
    double squares = 0, flat = 0, weight = 0, lo = INFINITY, hi = -INFINITY;
    std::array<bool, 72> seen{};
    const auto [u, v] = plane_axes(c.axis);
    for_samples(out.patches, [&](std::uint32_t i, double w) {
      const Vec3& p = samples_.points[i];
      const Vec3 d = minus(p, c.on_axis);
      const double off = distance_to_axis(c, p) - c.radius_m;
      const double noise = patches_[samples_.patch[i]].noise_m;
      squares += w * (off * off + noise * noise);
      flat += w * (squared_off_plane(i) + noise * noise);
      weight += w;
      lo = std::min(lo, dot(d, c.axis));
      hi = std::max(hi, dot(d, c.axis));
      const double turn = std::atan2(dot(d, v), dot(d, u)) / (2 * std::numbers::pi) + 0.5;
      seen[std::min<std::size_t>(71, static_cast<std::size_t>(turn * 72))] = true;
    });
    out.rms_m = std::sqrt(squares / weight);
    out.planes_rms_m = std::sqrt(flat / weight);
    out.length_m = hi - lo;
    out.radius_m = c.radius_m;
    out.arc_rad = double(std::count(seen.begin(), seen.end(), true)) * std::numbers::pi / 36;
    set_axis(c, (lo + hi) / 2, out);
    add_patches(out);
  }

  [[nodiscard]] double squared_off_plane(std::uint32_t sample) const {
    const std::int32_t plane = plane_of_[samples_.patch[sample]];
    if (plane < 0) return 0;
    const MapPlane& m = planes_[std::size_t(plane)];
    const double d = dot(minus(samples_.points[sample], m.center), m.normal);
    return d * d;
  }

  static void set_axis(const RansacCylinder& c, double middle, MapCylinder& out) {
    out.axis = c.axis;
    const auto longer = [](double a, double b) { return std::abs(a) < std::abs(b); };
    const bool turn = *std::max_element(c.axis.begin(), c.axis.end(), longer) < 0;
    for (std::size_t d = 0; d < 3; ++d) {
      out.center[d] = c.on_axis[d] + middle * c.axis[d];
      if (turn) out.axis[d] = -c.axis[d];
    }
  }

  void add_patches(MapCylinder& out) const {
    std::vector<std::uint64_t> of_plane(planes_.size(), 0);
    double colored = 0;
    for (const std::uint32_t i : out.patches) {
      const SurfacePatch& p = patches_[i];
      out.points += p.points;
      if (plane_of_[i] < 0) {
        ++out.planes;
      } else {
        of_plane[std::size_t(plane_of_[i])] += p.points;
      }
      if (!p.colored) continue;
      colored += double(p.points);
      for (std::size_t c = 0; c < 3; ++c) out.rgb[c] += double(p.points) * p.rgb[c];
    }
    for (std::size_t i = 0; i < planes_.size(); ++i) out.planes += 2 * of_plane[i] > planes_[i].points;
    out.colored = colored > 0;
    for (double& c : out.rgb) c /= out.colored ? colored : 1;
  }

  std::span<const SurfacePatch> patches_;
  std::span<const MapPlane> planes_;
  const Samples& samples_;
  CylinderSettings settings_;
  std::vector<std::int32_t> plane_of_;
};

}  // namespace

Result<std::vector<MapCylinder>> find_cylinders(std::span<const SurfacePatch> patches,
                                                std::span<const MapPlane> planes,
                                                const CylinderSettings& settings) {
  const Samples samples = sample_all(patches, settings.tolerance_m);
  RansacSettings ransac;
  ransac.distance_m = 2 * settings.tolerance_m;
  ransac.cluster_m = 3 * samples.spacing_m;
  ransac.least_points = std::max<std::size_t>(40, samples.points.size() / 2000);
  MAPCODEC_ASSIGN(std::vector<RansacCylinder> found,
                  ransac_cylinders(samples.points, samples.normals, ransac));
  const Chooser chooser(patches, planes, samples, settings);
  std::vector<MapCylinder> kept;
  for (RansacCylinder& c : found) {
    MapCylinder cylinder;
    if (chooser.choose(std::move(c), cylinder)) kept.push_back(std::move(cylinder));
  }
  std::stable_sort(kept.begin(), kept.end(),
                   [](const MapCylinder& a, const MapCylinder& b) { return a.points > b.points; });
  return kept;
}

#else

Result<std::vector<MapCylinder>> find_cylinders(std::span<const SurfacePatch>, std::span<const MapPlane>,
                                                const CylinderSettings&) {
  return make_error(ErrorCode::kUnsupported, "cylinders need a build with CGAL");
}

#endif

}  // namespace mapcodec
