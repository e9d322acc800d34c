// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mesh_orient.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "slam_adapter/plane_moments.hpp"

namespace mapcodec {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

struct Edge {
  std::uint32_t low, high;  ///< vertices
  std::uint32_t face;
  std::uint8_t side;  ///< of the face
  bool upwards;       ///< the face runs from low to high
};

struct Neighbor {
  std::uint32_t face = kNone;
  bool agrees = true;  ///< runs along the common edge in the other sense
};
using Neighbors = std::vector<std::array<Neighbor, 3>>;

Neighbors neighbors_of(const SurfaceMesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.faces.size());
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::uint8_t s = 0; s < 3; ++s) {
      const std::uint32_t a = mesh.faces[f][s], b = mesh.faces[f][(s + 1u) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), f, s, a < b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.low, a.high, a.face, a.side) < std::tie(b.low, b.high, b.face, b.side);
  });
  Neighbors neighbors(mesh.faces.size());
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && edges[end].low == edges[begin].low && edges[end].high == edges[begin].high)
      ++end;
    if (end - begin != 2) continue;
    const Edge &a = edges[begin], &b = edges[begin + 1];
    neighbors[a.face][a.side] = {b.face, a.upwards != b.upwards};
    neighbors[b.face][b.side] = {a.face, a.upwards != b.upwards};
  }
  return neighbors;
}

double area_of(const SurfaceMesh& mesh, const std::array<std::uint32_t, 3>& face) {
  const Vec3 a = minus(mesh.vertices[face[1]], mesh.vertices[face[0]]);
  const Vec3 b = minus(mesh.vertices[face[2]], mesh.vertices[face[0]]);
  const double aa = dot(a, a), bb = dot(b, b), ab = dot(a, b);
  return std::sqrt(std::max(0.0, aa * bb - ab * ab)) / 2;
}

}  // namespace

void orient_faces(SurfaceMesh& mesh) {
  const Neighbors neighbors = neighbors_of(mesh);
  std::vector<std::uint8_t> seen(mesh.faces.size(), 0), turned(mesh.faces.size(), 0);
  std::vector<std::uint32_t> piece;
  for (std::uint32_t first = 0; first < mesh.faces.size(); ++first) {
    if (seen[first] != 0) continue;
    piece.assign(1, first);
    seen[first] = 1;
    double kept = 0;
    for (std::size_t i = 0; i < piece.size(); ++i) {
      const std::uint32_t f = piece[i];
      kept += (turned[f] != 0 ? -1 : 1) * area_of(mesh, mesh.faces[f]);
      for (const Neighbor& n : neighbors[f]) {
        if (n.face == kNone || seen[n.face] != 0) continue;
        seen[n.face] = 1;
        turned[n.face] = n.agrees ? turned[f] : !turned[f];
        piece.push_back(n.face);
      }
    }
    for (const std::uint32_t f : piece) {
      if ((turned[f] != 0) == (kept >= 0)) std::swap(mesh.faces[f][1], mesh.faces[f][2]);
    }
  }
}

}  // namespace mapcodec
