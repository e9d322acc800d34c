// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/plane_outline.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace mapcodec {
namespace {

using Point2 = std::array<double, 2>;
using Ring = std::vector<Point2>;

constexpr std::int64_t kMargin = 3;     // cells around all, for closing gaps
constexpr double kMostCells = 1 << 22;  // of one plane
constexpr double kLeastHoleCells = 12;  // smaller ones are gaps between samples

double twice_area(const Ring& ring) {
  double sum = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Point2 &a = ring[i], &b = ring[(i + 1) % ring.size()];
    sum += a[0] * b[1] - a[1] * b[0];
  }
  return sum;
}

/// Cells that are covered; coordinates are in cells from the lower corner.
struct Picture {
  std::int64_t width = 0, height = 0;
  std::vector<std::uint8_t> cells;

  [[nodiscard]] bool at(std::int64_t x, std::int64_t y) const {
    return x >= 0 && y >= 0 && x < width && y < height && cells[std::size_t(y * width + x)] != 0;
  }
  void set(std::int64_t x, std::int64_t y) { cells[std::size_t(y * width + x)] = 1; }
};

/// @param ring  convex, any sense. Cells whose centre is at most half a cell outside are covered.
void draw(Ring ring, Picture& picture) {
  if (twice_area(ring) < 0) std::reverse(ring.begin(), ring.end());
  Point2 lo = ring[0], hi = ring[0];
  for (const Point2& p : ring) {
    for (std::size_t d = 0; d < 2; ++d) {
      lo[d] = std::min(lo[d], p[d]);
      hi[d] = std::max(hi[d], p[d]);
    }
  }
  const auto inside = [&](double x, double y) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point2 &a = ring[i], &b = ring[(i + 1) % ring.size()];
      const double ex = b[0] - a[0], ey = b[1] - a[1];
      if (ex * (y - a[1]) - ey * (x - a[0]) < -0.5 * std::sqrt(ex * ex + ey * ey)) return false;
    }
    return true;
  };
  const auto from = [](double v) { return std::max<std::int64_t>(0, std::int64_t(std::floor(v - 0.5))); };
  const auto to = [](double v, std::int64_t n) { return std::min(n - 1, std::int64_t(std::ceil(v + 0.5))); };
  for (std::int64_t y = from(lo[1]); y <= to(hi[1], picture.height); ++y) {
    for (std::int64_t x = from(lo[0]); x <= to(hi[0], picture.width); ++x) {
      const double cx = double(x) + 0.5, cy = double(y) + 0.5;
      const bool near = cx > lo[0] - 0.5 && cx < hi[0] + 0.5 && cy > lo[1] - 0.5 && cy < hi[1] + 0.5;
      if (near && inside(cx, cy)) picture.set(x, y);
    }
  }
}

/// Covered, where any (or all) of a cell and its eight neighbours are.
Picture morph(const Picture& p, bool any) {
  Picture r{p.width, p.height, std::vector<std::uint8_t>(p.cells.size(), 0)};
  for (std::int64_t y = 1; y + 1 < p.height; ++y) {
    for (std::int64_t x = 1; x + 1 < p.width; ++x) {
      int n = 0;
      for (std::int64_t dy = -1; dy <= 1; ++dy) {
        for (std::int64_t dx = -1; dx <= 1; ++dx) n += p.cells[std::size_t((y + dy) * p.width + x + dx)];
      }
      if (any ? n > 0 : n == 9) r.set(x, y);
    }
  }
  return r;
}

using Corner = std::array<std::int64_t, 2>;

/// The edges between covered and other cells, linked to rings with the covered cells on the left.
class Tracer {
 public:
  explicit Tracer(const Picture& picture) {
    for (std::int64_t y = 0; y < picture.height; ++y) {
      for (std::int64_t x = 0; x < picture.width; ++x) {
        if (!picture.at(x, y)) continue;
        if (!picture.at(x, y - 1)) add({x, y}, {x + 1, y});
        if (!picture.at(x + 1, y)) add({x + 1, y}, {x + 1, y + 1});
        if (!picture.at(x, y + 1)) add({x + 1, y + 1}, {x, y + 1});
        if (!picture.at(x - 1, y)) add({x, y + 1}, {x, y});
      }
    }
  }

  std::vector<Ring> rings() {
    std::vector<Ring> rings;
    while (!edges_.empty()) rings.push_back(next_ring());
    return rings;
  }

 private:
  void add(const Corner& a, const Corner& b) { edges_[a].push_back(b); }

  /// Where cells touch at a corner only, the ring turns left, around its own cell.
  Corner take(const Corner& at, const Corner& came_by) {
    const auto it = edges_.find(at);
    std::vector<Corner>& ways = it->second;
    std::size_t best = 0;
    for (std::size_t i = 1; i < ways.size(); ++i) {
      const std::int64_t turn = came_by[0] * (ways[i][1] - at[1]) - came_by[1] * (ways[i][0] - at[0]);
      if (turn > 0) best = i;
    }
    const Corner next = ways[best];
    ways.erase(ways.begin() + std::ptrdiff_t(best));
    if (ways.empty()) edges_.erase(it);
    return next;
  }

  Ring next_ring() {
    Ring ring;
    const Corner first = edges_.begin()->first;
    Corner at = first, came_by{0, 0};
    do {
      ring.push_back({double(at[0]), double(at[1])});
      const Corner next = take(at, came_by);
      came_by = {next[0] - at[0], next[1] - at[1]};
      at = next;
    } while (at != first);
    return ring;
  }

  std::map<Corner, std::vector<Corner>> edges_;
};

double distance(const Point2& p, const Point2& a, const Point2& b) {
  const double x = b[0] - a[0], y = b[1] - a[1], l = x * x + y * y;
  const double t = l > 0 ? std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / l, 0.0, 1.0) : 0;
  return std::hypot(p[0] - a[0] - t * x, p[1] - a[1] - t * y);
}

/// [Douglas, Peucker 1973] on a closed ring, between its two points farthest from each other along it.
Ring straighten(const Ring& ring, double tolerance) {
  std::vector<std::uint8_t> kept(ring.size() + 1, 0);
  std::size_t far = 0;
  double most = -1;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const double d = std::hypot(ring[i][0] - ring[0][0], ring[i][1] - ring[0][1]);
    if (d > most) {
      most = d;
      far = i;
    }
  }
  kept[0] = kept[far] = 1;
  std::vector<std::array<std::size_t, 2>> runs{{0, far}, {far, ring.size()}};
  while (!runs.empty()) {
    const auto [a, b] = runs.back();
    runs.pop_back();
    std::size_t at = a;
    double worst = tolerance;
    for (std::size_t i = a + 1; i < b; ++i) {
      const double d = distance(ring[i], ring[a], ring[b % ring.size()]);
      if (d > worst) {
        worst = d;
        at = i;
      }
    }
    if (at == a) continue;
    kept[at] = 1;
    runs.push_back({a, at});
    runs.push_back({at, b});
  }
  Ring r;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (kept[i] != 0) r.push_back(ring[i]);
  }
  return r;
}

bool encloses(const Ring& ring, const Point2& p) {
  bool in = false;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
    const Point2 &a = ring[i], &b = ring[j];
    if ((a[1] > p[1]) != (b[1] > p[1]) && p[0] < (b[0] - a[0]) * (p[1] - a[1]) / (b[1] - a[1]) + a[0])
      in = !in;
  }
  return in;
}

/// Plane coordinates in cells, and back.
struct Frame {
  Vec3 center;
  std::array<Vec3, 2> axes;
  Point2 low{0, 0};
  double cell = 1;

  [[nodiscard]] Point2 flat(const Vec3& p) const {
    const Vec3 d = minus(p, center);
    return {dot(d, axes[0]), dot(d, axes[1])};
  }
  [[nodiscard]] Vec3 back(const Point2& p) const {
    Vec3 r = center;
    for (std::size_t k = 0; k < 2; ++k) {
      for (std::size_t d = 0; d < 3; ++d) r[d] += (low[k] + (p[k] - kMargin) * cell) * axes[k][d];
    }
    return r;
  }
  [[nodiscard]] std::vector<Vec3> back(const Ring& ring) const {
    std::vector<Vec3> r;
    for (const Point2& p : ring) r.push_back(back(p));
    return r;
  }
};

Picture draw_all(std::span<const SurfacePatch> patches, std::span<const std::uint32_t> which, Frame& frame) {
  Point2 hi{-INFINITY, -INFINITY};
  frame.low = {INFINITY, INFINITY};
  for (const std::uint32_t i : which) {
    for (const Vec3& corner : patches[i].polygon) {
      const Point2 p = frame.flat(corner);
      for (std::size_t d = 0; d < 2; ++d) {
        frame.low[d] = std::min(frame.low[d], p[d]);
        hi[d] = std::max(hi[d], p[d]);
      }
    }
  }
  const double w = hi[0] - frame.low[0], h = hi[1] - frame.low[1];
  // Long strips, too, stay below the limit: each side alone, and both together.
  frame.cell = std::max({frame.cell, std::sqrt(w * h / kMostCells), std::max(w, h) / (kMostCells / 64)});
  Picture picture;
  picture.width = std::int64_t(w / frame.cell) + 1 + 2 * kMargin;
  picture.height = std::int64_t(h / frame.cell) + 1 + 2 * kMargin;
  picture.cells.assign(std::size_t(picture.width * picture.height), 0);
  for (const std::uint32_t i : which) {
    Ring ring;
    for (const Vec3& corner : patches[i].polygon) {
      const Point2 p = frame.flat(corner);
      ring.push_back(
          {(p[0] - frame.low[0]) / frame.cell + kMargin, (p[1] - frame.low[1]) / frame.cell + kMargin});
    }
    draw(std::move(ring), picture);
  }
  return picture;
}

}  // namespace

std::vector<PlaneOutline> outline_patches(std::span<const SurfacePatch> patches,
                                          std::span<const std::uint32_t> which, const Vec3& center,
                                          const Vec3& normal, double cell_m) {
  Frame frame{center, plane_axes(normal), {0, 0}, cell_m};
  const Picture picture = morph(morph(draw_all(patches, which, frame), true), false);
  std::vector<Ring> outer, holes;
  for (Ring& ring : Tracer(picture).rings()) {
    const double twice = twice_area(ring);
    if (twice > 0) outer.push_back(std::move(ring));
    if (twice < -2 * kLeastHoleCells) holes.push_back(std::move(ring));
  }
  std::stable_sort(outer.begin(), outer.end(),
                   [](const Ring& a, const Ring& b) { return twice_area(a) > twice_area(b); });
  const double unit = frame.cell * frame.cell / 2;
  std::vector<PlaneOutline> outlines(outer.size());
  for (std::size_t i = 0; i < outer.size(); ++i) {
    outlines[i].ring = frame.back(straighten(outer[i], 1));
    outlines[i].area_m2 = twice_area(outer[i]) * unit;
  }
  for (const Ring& hole : holes) {
    // Of nested outlines the innermost, which is the smallest.
    for (std::size_t i = outer.size(); i-- > 0;) {
      const Point2 within{hole[0][0] + 0.5 * (hole[1][0] - hole[0][0]),
                          hole[0][1] + 0.5 * (hole[1][1] - hole[0][1])};
      if (!encloses(outer[i], within)) continue;
      const Ring simple = straighten(hole, 1);
      if (simple.size() >= 3) outlines[i].holes.push_back(frame.back(simple));
      outlines[i].area_m2 += twice_area(hole) * unit;
      break;
    }
  }
  std::erase_if(outlines, [](const PlaneOutline& o) { return o.ring.size() < 3; });
  return outlines;
}

}  // namespace mapcodec
