// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/peers/grid.hpp"

#include "mapcodec/geometry/morton.hpp"

namespace mapcodec::peers {

Vec3 Grid::centre(const VoxelCoord& cell) const {
  Vec3 p{};
  for (std::size_t d = 0; d < 3; ++d) p[d] = corner[d] + (cell[d] + 0.5) * step_m;
  return p;
}

Result<Grid> make_grid(const std::vector<Vec3>& points, double step_m) {
  Box box;
  for (const Vec3& p : points) box.add(p);
  for (std::size_t d = 0; d < 3; ++d) {
    if (!((box.max[d] - box.min[d]) / step_m < double((1u << kMortonBits) - 1))) {
      return make_error(ErrorCode::kInvalidArgument, "more than 2^21 cells a side");
    }
  }
  Grid grid{box.min, step_m, {}};
  grid.cells.reserve(points.size());
  for (const Vec3& p : points) {
    VoxelCoord c{};
    for (std::size_t d = 0; d < 3; ++d) c[d] = static_cast<std::uint32_t>((p[d] - box.min[d]) / step_m);
    grid.cells.push_back(c);
  }
  return grid;
}

}  // namespace mapcodec::peers
