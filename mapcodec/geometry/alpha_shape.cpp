// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/alpha_shape.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

using Square = std::pair<std::int64_t, std::int64_t>;

struct Entry {
  Square square;
  std::uint32_t point;
  auto operator<=>(const Entry&) const = default;
};

std::vector<Entry> sort_into_squares(std::span<const Point2> points, double side_m) {
  std::vector<Entry> entries;
  entries.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    entries.push_back({{static_cast<std::int64_t>(std::floor(points[i][0] / side_m)),
                        static_cast<std::int64_t>(std::floor(points[i][1] / side_m))},
                       i});
  }
  std::sort(entries.begin(), entries.end());
  return entries;
}

bool is_surrounded(const Square& at, const std::vector<Square>& taken) {
  for (std::int64_t x = -1; x <= 1; ++x) {
    // The three squares of a column follow each other where all are taken.
    const Square first{at.first + x, at.second - 1};
    const auto found = std::lower_bound(taken.begin(), taken.end(), first);
    if (taken.end() - found < 3 || found[0] != first || found[2] != Square{first.first, first.second + 2})
      return false;
  }
  return true;
}

}  // namespace

std::vector<std::uint32_t> thin_inner_points(std::span<const Point2> points, double side_m) {
  const std::vector<Entry> entries = sort_into_squares(points, side_m);
  std::vector<Square> taken;
  for (const Entry& e : entries) {
    if (taken.empty() || taken.back() != e.square) taken.push_back(e.square);
  }
  std::vector<std::uint32_t> kept;
  bool surrounded = false;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const bool first = i == 0 || entries[i - 1].square != entries[i].square;
    if (first) surrounded = is_surrounded(entries[i].square, taken);
    if (first || !surrounded) kept.push_back(entries[i].point);
  }
  std::sort(kept.begin(), kept.end());
  return kept;
}

Result<std::vector<Contour>> find_concave_hull(std::span<const Point2> points, double alpha_m) {
  const std::vector<std::uint32_t> kept = thin_inner_points(points, alpha_m / 4);
  std::vector<Point2> thinned;
  thinned.reserve(kept.size());
  for (const std::uint32_t i : kept) thinned.push_back(points[i]);
  MAPCODEC_ASSIGN(std::vector<Contour> contours, find_alpha_contours(thinned, alpha_m));
  for (Contour& contour : contours) {
    for (std::uint32_t& i : contour) i = kept[i];
  }
  return contours;
}

}  // namespace mapcodec
