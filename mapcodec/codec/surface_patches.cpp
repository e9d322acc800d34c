// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_patches.hpp"

#include <memory>

#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/codec/surface_blocks.hpp"
#include "mapcodec/codec/surface_layout.hpp"
#include "mapcodec/geometry/radix_sort.hpp"

namespace mapcodec {
namespace {

using surface::Leaf;
using surface::SubUnits;

// Two levels of cells and the leaves, the points and what sorting them takes; see decode_surface.
constexpr std::uint64_t kTreeBytesPerPoint = 2 * 112 + 2 * sizeof(Leaf) + 2 * sizeof(SubUnits) +
                                             sizeof(VoxelCoord) + 2 * sizeof(KeyedIndex) +
                                             2 * sizeof(std::uint32_t);
constexpr std::uint64_t kBytesPerPatch = sizeof(SurfacePatch) + 12 * sizeof(Vec3);

struct Tree {
  surface::Header header;
  std::vector<Leaf> leaves;
  std::vector<surface::Block> blocks;
  std::vector<surface::Joint> joints;
};

Status check(const Tree& tree, std::uint64_t count, const DecodeLimits& limits) {
  std::uint64_t sum = 0;
  for (const Leaf& leaf : tree.leaves) sum += leaf.block < 0 ? leaf.count : 0;
  for (const surface::Block& block : tree.blocks) sum += block.count;
  if (sum != count) return make_error(ErrorCode::kMalformed, "surface tree has not its points");
  if (tree.leaves.size() > limits.max_bytes / kBytesPerPatch) {
    return make_error(ErrorCode::kLimitExceeded, "surface patches need more memory than allowed");
  }
  return {};
}

Result<Tree> read_tree(ByteSpan bytes, std::uint64_t count, const DecodeLimits& limits) {
  if (count == 0) return make_error(ErrorCode::kMalformed, "surface tile without points");
  if (count > limits.max_points || count > limits.max_bytes / kTreeBytesPerPoint || count > 0x7fffffffu) {
    return make_error(ErrorCode::kLimitExceeded, "surface points need more memory than allowed");
  }
  ByteReader in(bytes);
  Tree tree;
  MAPCODEC_ASSIGN(tree.header, surface::read_header(in));
  SymbolReader reader(in.raw(in.left()));
  // The models are too large for small stacks.
  const auto walk = std::make_unique<surface::Walk<SymbolReader>>(reader);
  walk->models().count_shift = tree.header.count_shift;
  walk->models().outline = outline_of(tree.header);
  walk->models().voxel_bits = tree.header.block_bits;
  if (!walk->run(static_cast<std::uint32_t>(count), tree.header.depth, ~0u)) {
    return make_error(ErrorCode::kTruncated, "surface tree ends too early");
  }
  tree.leaves = std::move(walk->leaves());
  tree.blocks = walk->blocks();
  tree.joints = walk->joints();
  MAPCODEC_TRY(check(tree, count, limits));
  return tree;
}

Vec3 minus(const Vec3& a, const Vec3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double length(const Vec3& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/// Where things in a tile lie [m].
struct Frame {
  Vec3 origin;  ///< the root cell's lowest corner
  double unit;  ///< side of a unit
};

Frame frame_of(const surface::Header& header, const Quantizer& lattice) {
  Frame f{{}, lattice.step_m / surface::kStepUnits};
  for (std::size_t d = 0; d < 3; ++d)
    f.origin[d] = lattice.origin[d] + static_cast<double>(header.base[d]) * f.unit;
  return f;
}

/// Half of a cell's side [units].
double half_units(const Leaf& leaf, unsigned axis) {
  return std::ldexp(0.5, leaf.shape[axis]);
}

Vec3 corner(const Leaf& leaf, const surface::Vertex& x, const Frame& frame) {
  const unsigned k = leaf.plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  Vec3 at;
  at[u] = half_units(leaf, u) * std::ldexp(x.u, -surface::kVertexBits);
  at[v] = half_units(leaf, v) * std::ldexp(x.v, -surface::kVertexBits);
  at[k] = std::ldexp(static_cast<double>(height_at(leaf.plane, leaf.shape, x)), -surface::kHeightBits);
  for (unsigned d = 0; d < 3; ++d)
    at[d] = frame.origin[d] + (leaf.at[d] + half_units(leaf, d) + at[d]) * frame.unit;
  return at;
}

Vec3 normal_of(const Leaf& leaf) {
  const unsigned k = leaf.plane.axis, u = (k + 1) % 3, v = (k + 2) % 3;
  Vec3 n;
  n[u] = -std::ldexp(leaf.plane.a, -surface::kHeightBits) / half_units(leaf, u);
  n[v] = -std::ldexp(leaf.plane.b, -surface::kHeightBits) / half_units(leaf, v);
  n[k] = 1;
  const double l = length(n);
  for (double& x : n) x /= l;
  return n;
}

/// Area and centroid, by the triangles around the first corner.
void measure(SurfacePatch& patch) {
  const Vec3& first = patch.polygon[0];
  Vec3 sum{};
  for (std::size_t i = 1; i + 1 < patch.polygon.size(); ++i) {
    const Vec3 a = minus(patch.polygon[i], first), b = minus(patch.polygon[i + 1], first);
    const double area = length(cross(a, b)) / 2;
    patch.area_m2 += area;
    for (std::size_t d = 0; d < 3; ++d) sum[d] += area * (a[d] + b[d]) / 3;
  }
  for (std::size_t d = 0; d < 3 && patch.area_m2 > 0; ++d)
    patch.center[d] = first[d] + sum[d] / patch.area_m2;
}

/// Root mean square of points spread evenly over +-2^(noise + 2) heights of a unit along the plane's axis.
double noise_of(const Leaf& leaf, const SurfacePatch& patch, double unit) {
  if (leaf.noise == 0) return 0;
  return std::ldexp(unit, leaf.noise + 2) / std::sqrt(3.0) * std::abs(patch.normal[leaf.plane.axis]);
}

/// @return false if the leaf has no piece of a plane.
bool patch_of_leaf(const Leaf& leaf, const surface::Outline& outline, const Frame& frame,
                   SurfacePatch& patch) {
  if (!leaf.has_plane || leaf.count == 0) return false;
  const surface::Room room = surface::Room::in(outline, leaf.at, leaf.shape);
  surface::Polygon polygon =
      polygon_of(leaf.plane, leaf.shape, leaf.block < 0 ? room : surface::Room::whole(leaf.shape));
  if (polygon.size >= 3 && leaf.wedged) cut(polygon, leaf.wedge);
  if (polygon.size < 3 || twice_area(polygon) <= 0) return false;
  for (int i = 0; i < polygon.size; ++i)
    patch.polygon.push_back(corner(leaf, polygon.at[static_cast<std::size_t>(i)], frame));
  measure(patch);
  patch.normal = normal_of(leaf);
  patch.points = leaf.count;
  patch.noise_m = noise_of(leaf, patch, frame.unit);
  return patch.area_m2 > 0 && is_finite(patch.center) && is_finite(patch.normal);
}

/// Calls f(leaf) in the order of the points: those of the cells, then those of the voxels.
template <class F>
void in_point_order(const std::vector<Leaf>& leaves, F&& f) {
  for (const Leaf& leaf : leaves) {
    if (leaf.block < 0) f(leaf);
  }
  for (const Leaf& leaf : leaves) {
    if (leaf.block >= 0) f(leaf);
  }
}

/// @param owner  if not null: the patch of each point in tree order.
std::vector<SurfacePatch> patches_of(const Tree& tree, const Quantizer& lattice,
                                     std::vector<std::uint32_t>* owner) {
  const Frame frame = frame_of(tree.header, lattice);
  const surface::Outline outline = outline_of(tree.header);
  std::vector<SurfacePatch> patches;
  in_point_order(tree.leaves, [&](const Leaf& leaf) {
    SurfacePatch patch;
    const bool any = patch_of_leaf(leaf, outline, frame, patch);
    if (owner != nullptr) {
      owner->insert(owner->end(), leaf.count, any ? static_cast<std::uint32_t>(patches.size()) : kNoPatch);
    }
    if (any) patches.push_back(std::move(patch));
  });
  return patches;
}

Status check_step(const Quantizer& lattice) {
  if (lattice.step_m > 0 && std::isfinite(lattice.step_m)) return {};
  return make_error(ErrorCode::kMalformed, "surface tile has no step");
}

}  // namespace

Result<std::vector<SurfacePatch>> read_surface_patches(ByteSpan bytes, std::uint64_t count,
                                                       const Quantizer& lattice, const DecodeLimits& limits) {
  MAPCODEC_TRY(check_step(lattice));
  MAPCODEC_ASSIGN(Tree tree, read_tree(bytes, count, limits));
  if (!tree.blocks.empty()) {
    // The surface through voxels depends on where all other points lie.
    (void)surface::points_of(tree.leaves, tree.blocks, count, tree.header, tree.joints);
  }
  return patches_of(tree, lattice, nullptr);
}

Result<SurfacePatchPoints> read_surface_patch_points(ByteSpan bytes, std::uint64_t count,
                                                     const Quantizer& lattice, const DecodeLimits& limits) {
  MAPCODEC_TRY(check_step(lattice));
  MAPCODEC_ASSIGN(Tree tree, read_tree(bytes, count, limits));
  if (tree.header.voxel_shift == surface::kNoVoxels) {
    return make_error(ErrorCode::kMalformed, "surface tile has no order for channels");
  }
  const std::vector<SubUnits> points =
      surface::points_of(tree.leaves, tree.blocks, count, tree.header, tree.joints);
  SurfacePatchPoints r;
  std::vector<std::uint32_t> owner;
  owner.reserve(count);
  r.patches = patches_of(tree, lattice, &owner);
  if (points.size() != count || owner.size() != count) {
    return make_error(ErrorCode::kMalformed, "surface tree has not its points");
  }
  surface::VoxelOrder sorted = surface::order_by_voxels(points, tree.header.depth, tree.header.voxel_shift);
  r.voxels = std::move(sorted.voxels);
  r.patch_of.reserve(count);
  for (const std::uint32_t i : sorted.order) r.patch_of.push_back(owner[i]);
  return r;
}

}  // namespace mapcodec
