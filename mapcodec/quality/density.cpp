// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/density.hpp"

#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <vector>

namespace mapcodec {
namespace {

using Cell = std::array<std::int64_t, 3>;

/// Cells of one grid. Equal to floor((x + offset) / side) in double, to the last bit.
class Grid {
 public:
  Grid(double side, double offset) : side_(side), offset_(offset), inverse_(1 / side) {}

  [[nodiscard]] Cell cell(const Vec3& p) const { return {index(p[0]), index(p[1]), index(p[2])}; }

 private:
  [[nodiscard]] std::int64_t index(double x) const {
    const double moved = x + offset_;
    const double guess = moved * inverse_;
    if (!(std::abs(guess) < 1e8)) return exact(moved);
    const auto i = static_cast<std::int64_t>(guess + 0x1p30) - (std::int64_t{1} << 30);
    const double fraction = guess - static_cast<double>(i);
    // Multiplying is not dividing: close to a face only the division tells the side.
    return fraction > 1e-7 && fraction < 1 - 1e-7 ? i : exact(moved);
  }
  [[nodiscard]] std::int64_t exact(double moved) const {
    const double v = std::floor(moved / side_);
    return static_cast<std::int64_t>(std::min(std::max(v, -9.2e18), 9.2e18));
  }

  double side_, offset_, inverse_;
};

/// Open addressing from cells to n_decoded - n_original; it never shrinks and nothing is erased. Cells are
/// packed into 63 bits around a middle one; those beyond (100 km at 10 cm) go to an ordinary map.
class Differences {
 public:
  explicit Differences(const Cell& middle) : middle_(middle), slots_(kFirstSlots) {}

  void add(const Cell& cell, std::int64_t change) {
    const std::uint64_t key = pack(cell);
    if (key == kFar) {
      far_[cell] += change;
    } else if (key == last_key_) {
      last_->difference += change;
    } else {
      add_new(key, change);
    }
  }
  [[nodiscard]] double sum_of_magnitudes() const {
    std::uint64_t sum = 0;
    for (const Slot& s : slots_) sum += static_cast<std::uint64_t>(std::abs(s.difference));
    for (const auto& [cell, difference] : far_) sum += static_cast<std::uint64_t>(std::abs(difference));
    return static_cast<double>(sum);
  }

 private:
  static constexpr std::uint64_t kFar = ~std::uint64_t{0}, kEmpty = kFar - 1;
  static constexpr std::size_t kFirstSlots = 1024;
  struct Slot {
    std::uint64_t key = kEmpty;
    std::int64_t difference = 0;
  };

  [[nodiscard]] std::uint64_t pack(const Cell& c) const {
    constexpr std::uint64_t kHalf = std::uint64_t{1} << 20;
    std::uint64_t d[3];
    for (std::size_t i = 0; i < 3; ++i) {
      d[i] = static_cast<std::uint64_t>(c[i]) - static_cast<std::uint64_t>(middle_[i]) + kHalf;
    }
    return (d[0] | d[1] | d[2]) >> 21 ? kFar : d[0] << 42 | d[1] << 21 | d[2];
  }
  void add_new(std::uint64_t key, std::int64_t change) {
    if (2 * used_ >= slots_.size()) grow();
    last_ = find(key);
    last_key_ = key;
    last_->difference += change;
  }
  Slot* find(std::uint64_t key) {
    const std::size_t mask = slots_.size() - 1;
    const std::uint64_t h = (key ^ (key >> 32)) * 0x9E3779B97F4A7C15u;
    std::size_t i = static_cast<std::size_t>(h >> 20) & mask;
    while (slots_[i].key != key && slots_[i].key != kEmpty) i = (i + 1) & mask;
    used_ += slots_[i].key == kEmpty;
    slots_[i].key = key;
    return &slots_[i];
  }
  void grow() {
    std::vector<Slot> old(slots_.size() * 4);
    old.swap(slots_);
    used_ = 0;
    for (const Slot& s : old) {
      if (s.key != kEmpty) find(s.key)->difference = s.difference;
    }
  }

  Cell middle_;
  std::vector<Slot> slots_;
  std::map<Cell, std::int64_t> far_;
  Slot* last_ = nullptr;
  std::uint64_t last_key_ = kEmpty;
  std::size_t used_ = 0;
};

std::size_t count_finite(std::span<const Vec3> points) {
  std::size_t n = 0;
  for (const Vec3& p : points) n += is_finite(p);
  return n;
}

Vec3 first_finite(std::span<const Vec3> points) {
  const auto at = std::find_if(points.begin(), points.end(), is_finite);
  return at == points.end() ? Vec3{0, 0, 0} : *at;
}

void add_all(std::span<const Vec3> points, const Grid& grid, std::int64_t change, Differences& to) {
  for (const Vec3& p : points) {
    if (is_finite(p)) to.add(grid.cell(p), change);
  }
}

/// Cells of four grids, each a quarter of a voxel farther, from one look: their faces all lie on the grid of
/// quarters.
class QuarterGrid {
 public:
  explicit QuarterGrid(double side) : inverse_(4 / side) {}

  /// Quarters of `p` on each axis; false close to a face or far away, where only a division tells the side.
  [[nodiscard]] bool quarters(const Vec3& p, Cell& q) const {
    bool sure = true;
    for (std::size_t d = 0; d < 3; ++d) {
      const double guess = p[d] * inverse_;
      const bool near = std::abs(guess) < 1e8;
      q[d] = near ? static_cast<std::int64_t>(guess + 0x1p30) - (std::int64_t{1} << 30) : 0;
      const double fraction = guess - static_cast<double>(q[d]);
      sure = sure && near && fraction > 1e-6 && fraction < 1 - 1e-6;
    }
    return sure;
  }
  [[nodiscard]] static Cell cell(const Cell& q, int shift) {
    return {(q[0] + shift) >> 2, (q[1] + shift) >> 2, (q[2] + shift) >> 2};
  }

 private:
  double inverse_;
};

/// One of the shifted grids and what has moved between its cells.
struct Shifted {
  Grid grid;
  Differences differences;

  void move(const Cell& from, const Cell& to) {
    if (from == to) return;
    differences.add(from, -1);
    differences.add(to, 1);
  }
};

}  // namespace

double density_difference(std::span<const Vec3> original, std::span<const Vec3> decoded, double voxel_m,
                          double offset_m) {
  const Grid grid(voxel_m, offset_m);
  Differences differences(grid.cell(first_finite(original)));
  add_all(original, grid, -1, differences);
  add_all(decoded, grid, 1, differences);
  return differences.sum_of_magnitudes();
}

double density_error_of_moved(std::span<const Vec3> original, std::span<const Vec3> decoded,
                              std::span<const std::uint32_t> order, double voxel_m) {
  const auto n = static_cast<double>(count_finite(original));
  if (n == 0) return std::numeric_limits<double>::quiet_NaN();
  constexpr int kShifts = 4;
  const QuarterGrid quarters(voxel_m);
  std::vector<Shifted> grids;
  for (int s = 0; s < kShifts; ++s) {
    const Grid grid(voxel_m, voxel_m * s / kShifts);
    grids.push_back({grid, Differences(grid.cell(first_finite(original)))});
  }
  for (std::size_t i = 0; i < decoded.size(); ++i) {
    const Vec3 &from = original[order[i]], &to = decoded[i];
    if (!is_finite(from) || !is_finite(to)) continue;
    Cell a{}, b{};
    const bool sure_a = quarters.quarters(from, a), sure_b = quarters.quarters(to, b);
    if (sure_a && sure_b) {
      for (int s = 0; s < kShifts && a != b; ++s)
        grids[std::size_t(s)].move(QuarterGrid::cell(a, s), QuarterGrid::cell(b, s));
    } else {
      for (Shifted& g : grids) g.move(g.grid.cell(from), g.grid.cell(to));
    }
  }
  double sum = 0;
  for (const Shifted& g : grids) sum += g.differences.sum_of_magnitudes() / n / kShifts;
  return sum;
}

double density_error(std::span<const Vec3> original, std::span<const Vec3> decoded, double voxel_m,
                     int shifts) {
  const auto n = static_cast<double>(count_finite(original));
  if (n == 0) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0;
  for (int s = 0; s < shifts; ++s) {
    sum += density_difference(original, decoded, voxel_m, voxel_m * s / shifts) / n / shifts;
  }
  return sum;
}

}  // namespace mapcodec
