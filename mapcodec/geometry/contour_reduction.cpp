// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/contour_reduction.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

double squared_distance(const Point2& a, const Point2& b) {
  return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]);
}

double distance_to_segment(const Point2& p, const Point2& a, const Point2& b) {
  const double x = b[0] - a[0], y = b[1] - a[1];
  const double length = x * x + y * y;
  const double along =
      length > 0 ? std::clamp(((p[0] - a[0]) * x + (p[1] - a[1]) * y) / length, 0.0, 1.0) : 0;
  return std::sqrt(squared_distance(p, {a[0] + along * x, a[1] + along * y}));
}

/// Works on an open run of positions in the contour. An explicit stack, since a contour may be long and
/// degenerate.
class Reduction {
 public:
  Reduction(std::span<const Point2> points, std::span<const std::uint32_t> contour, double tolerance_m)
      : points_(points), contour_(contour), tolerance_(tolerance_m) {}

  /// Keeps `first` and what lies between it and `last`; not `last`.
  void keep_run(std::size_t first, std::size_t last, std::vector<std::uint32_t>& kept) {
    std::vector<std::pair<std::size_t, std::size_t>> stack{{first, last}};
    while (!stack.empty()) {
      const auto [a, b] = stack.back();
      stack.pop_back();
      const Split whole = split(a, b);
      if (whole.at != a && worth_splitting(a, b, whole)) {
        stack.emplace_back(whole.at, b);
        stack.emplace_back(a, whole.at);
      } else {
        kept.push_back(index(a));
      }
    }
  }
  [[nodiscard]] std::size_t farthest_from(std::size_t from) const {
    std::size_t best = from;
    double most = 0;
    for (std::size_t i = 0; i < contour_.size(); ++i) {
      const double d = squared_distance(point(from), point(i));
      if (d > most) {
        most = d;
        best = i;
      }
    }
    return best;
  }

 private:
  struct Split {
    std::size_t at;  ///< the run's first position if it has no inner point off the line
    double deviation;
  };
  // Positions run on past the end: the contour is closed.
  [[nodiscard]] std::uint32_t index(std::size_t i) const { return contour_[i % contour_.size()]; }
  [[nodiscard]] const Point2& point(std::size_t i) const { return points_[index(i)]; }

  [[nodiscard]] Split split(std::size_t a, std::size_t b) const {
    Split s{a, 0};
    for (std::size_t i = a + 1; i < b; ++i) {
      const double d = distance_to_segment(point(i), point(a), point(b));
      if (d > s.deviation) s = {i, d};
    }
    return s;
  }
  [[nodiscard]] double significance(std::size_t a, std::size_t b, double deviation) const {
    // The floor keeps two points, which never deviate, from being infinitely significant.
    return std::sqrt(squared_distance(point(a), point(b))) / std::max(deviation, tolerance_ / 4);
  }
  [[nodiscard]] bool worth_splitting(std::size_t a, std::size_t b, const Split& whole) const {
    if (whole.deviation > tolerance_) return true;
    if (whole.deviation <= tolerance_ / 4) return false;
    const double parts = std::max(significance(a, whole.at, split(a, whole.at).deviation),
                                  significance(whole.at, b, split(whole.at, b).deviation));
    return parts > significance(a, b, whole.deviation);
  }

  std::span<const Point2> points_;
  std::span<const std::uint32_t> contour_;
  double tolerance_;
};

}  // namespace

std::vector<std::uint32_t> reduce_contour(std::span<const Point2> points,
                                          std::span<const std::uint32_t> contour, double tolerance_m) {
  std::vector<std::uint32_t> kept;
  if (contour.empty()) return kept;
  Reduction reduction(points, contour, tolerance_m);
  // The two ends of (about) the longest diagonal are corners of any outline.
  const std::size_t a = reduction.farthest_from(0);
  const std::size_t b = reduction.farthest_from(a);
  const auto [first, second] = std::minmax(a, b);
  reduction.keep_run(first, second, kept);
  reduction.keep_run(second, first + contour.size(), kept);
  return kept;
}

}  // namespace mapcodec
