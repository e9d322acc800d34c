// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/planes_json.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>

namespace mapcodec {
namespace {

/// Text of numbers with so many digits after the point, none of them a zero at the end.
class Writer {
 public:
  explicit Writer(double tolerance_m) {
    digits_ = std::clamp(2 - static_cast<int>(std::floor(std::log10(tolerance_m))), 2, 12);
  }

  std::string number(double v, int digits) const {
    char text[400];
    const auto end = std::to_chars(text, text + sizeof text, v, std::chars_format::fixed, digits).ptr;
    std::string s(text, end);
    if (s.find('.') != std::string::npos) s.erase(s.find_last_not_of('0') + 1);
    if (s.back() == '.') s.pop_back();
    return s == "-0" ? "0" : s;
  }
  [[nodiscard]] std::string length(double v) const { return number(v, digits_); }
  [[nodiscard]] std::string unit(const Vec3& v) const { return list(v, 9); }
  [[nodiscard]] std::string point(const Vec3& v) const { return list(v, digits_); }
  [[nodiscard]] std::string color(const std::array<double, 3>& v) const { return list(v, 1); }
  [[nodiscard]] std::string ring(const std::vector<Vec3>& points) const {
    return joined(points, [this](const Vec3& p) { return point(p); });
  }
  template <class T, class F>
  std::string joined(const std::vector<T>& items, F&& text) const {
    std::string s = "[";
    for (std::size_t i = 0; i < items.size(); ++i) s += (i > 0 ? ", " : "") + text(items[i]);
    return s + "]";
  }

 private:
  std::string list(const Vec3& v, int digits) const {
    return "[" + number(v[0], digits) + ", " + number(v[1], digits) + ", " + number(v[2], digits) + "]";
  }
  int digits_;
};

std::string outline_text(const Writer& w, const PlaneOutline& o) {
  return "\"polygon\": " + w.ring(o.ring) +
         ", \"holes\": " + w.joined(o.holes, [&](const std::vector<Vec3>& hole) { return w.ring(hole); });
}

std::string plane_text(const Writer& w, const MapPlane& p) {
  std::string s = "\n  {\"normal\": " + w.unit(p.normal) + ", \"offset\": " + w.length(p.offset_m);
  s += ", \"points\": " + std::to_string(p.points) + ", \"rms\": " + w.number(p.rms_m, 9);
  s += ", \"area\": " + w.number(p.area_m2, 6) + ", \"center\": " + w.point(p.center);
  if (p.colored) s += ", \"color\": " + w.color(p.rgb);
  s += ",\n   " + outline_text(w, p.outlines.empty() ? PlaneOutline{} : p.outlines.front());
  const std::vector<PlaneOutline> more(p.outlines.begin() + (p.outlines.empty() ? 0 : 1), p.outlines.end());
  return s + ",\n   \"pieces\": " + w.joined(more, [&](const PlaneOutline& o) {
    return "{" + outline_text(w, o) + "}";
  }) + "}";
}

std::string cylinder_text(const Writer& w, const MapCylinder& c) {
  std::string s = "\n  {\"axis\": " + w.unit(c.axis) + ", \"center\": " + w.point(c.center);
  s += ", \"radius\": " + w.length(c.radius_m) + ", \"length\": " + w.length(c.length_m);
  s += ", \"arc\": " + w.number(c.arc_rad, 3) + ", \"points\": " + std::to_string(c.points);
  s += ", \"rms\": " + w.number(c.rms_m, 9) + ", \"planes_rms\": " + w.number(c.planes_rms_m, 9);
  s += ", \"planes\": " + std::to_string(c.planes);
  if (c.colored) s += ", \"color\": " + w.color(c.rgb);
  return s + "}";
}

template <class T>
std::uint64_t points_of(const std::vector<T>& primitives) {
  std::uint64_t n = 0;
  for (const T& p : primitives) n += p.points;
  return n;
}

}  // namespace

std::string primitives_json(const MapPrimitives& m) {
  const Writer w(m.tolerance_m);
  std::string s = "{\"format\": \"mapcodec planes\", \"version\": 1,\n \"map_points\": ";
  s += std::to_string(m.map_points) + ", \"plane_points\": " + std::to_string(points_of(m.planes));
  s += ", \"cylinder_points\": " + std::to_string(points_of(m.cylinders));
  s += ",\n \"patches\": " + std::to_string(m.patches) + ", \"tolerance_m\": " + w.number(m.tolerance_m, 9);
  s += ",\n \"planes\": " + w.joined(m.planes, [&](const MapPlane& p) { return plane_text(w, p); });
  if (m.with_cylinders) {
    s += ",\n \"cylinders\": " +
         w.joined(m.cylinders, [&](const MapCylinder& c) { return cylinder_text(w, c); });
  }
  return s + "}\n";
}

}  // namespace mapcodec
