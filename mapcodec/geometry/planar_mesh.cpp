// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/geometry/planar_mesh.hpp"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <algorithm>

namespace mapcodec {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Vertex = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, Kernel>;

struct AlphaFace {
  double squared_radius = 0;
  bool inside = false;
  std::array<bool, 3> walked{};  ///< side i, opposite vertex i, is part of a contour already
};
using Delaunay =
    CGAL::Delaunay_triangulation_2<Kernel,
                                   CGAL::Triangulation_data_structure_2<
                                       Vertex, CGAL::Triangulation_face_base_with_info_2<AlphaFace, Kernel>>>;

using NumberedFace =
    CGAL::Triangulation_face_base_with_info_2<std::uint32_t, Kernel,
                                              CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Constrained = CGAL::Constrained_Delaunay_triangulation_2<
    Kernel, CGAL::Triangulation_data_structure_2<Vertex, NumberedFace>, CGAL::No_constraint_intersection_tag>;

std::vector<std::pair<Kernel::Point_2, std::uint32_t>> number(std::span<const Point2> points) {
  std::vector<std::pair<Kernel::Point_2, std::uint32_t>> r;
  r.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i)
    r.emplace_back(Kernel::Point_2(points[i][0], points[i][1]), i);
  return r;
}

double squared_circumradius(const Delaunay::Face_handle& f) {
  return CGAL::to_double(
      CGAL::squared_radius(f->vertex(0)->point(), f->vertex(1)->point(), f->vertex(2)->point()));
}

/// Marks the faces that belong to the alpha shape.
void mark_inside(Delaunay& mesh, double alpha_m) {
  std::vector<double> radii;
  radii.reserve(mesh.number_of_faces());
  for (const auto& f : mesh.finite_face_handles()) {
    f->info().squared_radius = squared_circumradius(f);
    radii.push_back(f->info().squared_radius);
  }
  if (radii.empty()) return;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  const double limit = std::max(alpha_m * alpha_m, 2.0 * 2.0 * *middle);
  for (const auto& f : mesh.finite_face_handles()) f->info().inside = f->info().squared_radius <= limit;
}

bool is_inside(const Delaunay& mesh, const Delaunay::Face_handle& f) {
  return !mesh.is_infinite(f) && f->info().inside;
}

/// Follows the contour that holds side i of f, turning through the fan of inside faces at each vertex, so
/// that shapes that touch in one point get contours of their own.
Contour walk(const Delaunay& mesh, Delaunay::Face_handle f, int i) {
  Contour contour;
  while (!f->info().walked[static_cast<std::size_t>(i)]) {
    f->info().walked[static_cast<std::size_t>(i)] = true;
    contour.push_back(f->vertex(Delaunay::ccw(i))->info());
    const Delaunay::Vertex_handle v = f->vertex(Delaunay::cw(i));
    i = Delaunay::cw(f->index(v));  // the side that leaves v
    while (is_inside(mesh, f->neighbor(i))) {
      f = f->neighbor(i);
      i = Delaunay::cw(f->index(v));
    }
  }
  return contour;
}

std::vector<Contour> collect_contours(const Delaunay& mesh) {
  std::vector<Contour> contours;
  for (const auto& f : mesh.finite_face_handles()) {
    if (!f->info().inside) continue;
    for (int i = 0; i < 3; ++i) {
      if (f->info().walked[static_cast<std::size_t>(i)] || is_inside(mesh, f->neighbor(i))) continue;
      contours.push_back(walk(mesh, f, i));
    }
  }
  return contours;
}

void constrain(Constrained& mesh, std::span<const Constrained::Vertex_handle> handles,
               const Contour& contour) {
  for (std::size_t i = 0; i < contour.size(); ++i) {
    const std::uint32_t a = contour[i], b = contour[(i + 1) % contour.size()];
    if (a == b) continue;
    try {
      mesh.insert_constraint(handles[a], handles[b]);
    } catch (const Constrained::Intersection_of_constraints_exception&) {
      continue;  // see the header: left out
    }
  }
}

/// Spreads from the outside over all numbered faces, changing sides at every constraint.
std::vector<bool> find_inside(const Constrained& mesh, std::size_t faces) {
  std::vector<bool> inside(faces), seen(faces);
  std::vector<std::pair<Constrained::Face_handle, bool>> here;  // faces to look around from
  for (const auto& f : mesh.all_face_handles()) {
    if (mesh.is_infinite(f)) here.emplace_back(f, false);
  }
  while (!here.empty()) {
    const auto [f, is_inside_here] = here.back();
    here.pop_back();
    for (int i = 0; i < 3; ++i) {
      const Constrained::Face_handle n = f->neighbor(i);
      if (mesh.is_infinite(n) || seen[n->info()]) continue;
      seen[n->info()] = true;
      inside[n->info()] = is_inside_here != f->is_constrained(i);
      here.emplace_back(n, inside[n->info()]);
    }
  }
  return inside;
}

PlanarTriangles triangulate(std::span<const Point2> vertices, std::span<const Contour> contours,
                            std::span<const Point2> queries) {
  Constrained mesh;
  std::vector<Constrained::Vertex_handle> handles(vertices.size());
  const auto numbered = number(vertices);
  mesh.insert(numbered.begin(), numbered.end());
  for (const auto& v : mesh.finite_vertex_handles()) handles[v->info()] = v;
  for (const Contour& contour : contours) constrain(mesh, handles, contour);
  PlanarTriangles r;
  for (const auto& f : mesh.finite_face_handles()) {
    f->info() = static_cast<std::uint32_t>(r.triangles.size());
    r.triangles.push_back({f->vertex(0)->info(), f->vertex(1)->info(), f->vertex(2)->info()});
  }
  if (mesh.dimension() == 2) r.inside = find_inside(mesh, r.triangles.size());
  r.triangle_of.reserve(queries.size());
  Constrained::Face_handle at;
  for (const Point2& q : queries) {
    at = mesh.dimension() < 2 ? at : mesh.locate(Kernel::Point_2(q[0], q[1]), at);
    const bool outside = mesh.dimension() < 2 || at == nullptr || mesh.is_infinite(at);
    r.triangle_of.push_back(outside ? PlanarTriangles::kOutside : at->info());
  }
  return r;
}

}  // namespace

Result<std::vector<Contour>> find_alpha_contours(std::span<const Point2> points, double alpha_m) {
  try {
    Delaunay mesh;
    const auto numbered = number(points);
    mesh.insert(numbered.begin(), numbered.end());
    if (mesh.dimension() < 2) return std::vector<Contour>{};
    mark_inside(mesh, alpha_m);
    return collect_contours(mesh);
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string("alpha shape: ") + e.what());
  }
}

Result<PlanarTriangles> triangulate_contours(std::span<const Point2> vertices,
                                             std::span<const Contour> contours,
                                             std::span<const Point2> queries) {
  try {
    return triangulate(vertices, contours, queries);
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string("triangulation: ") + e.what());
  }
}

}  // namespace mapcodec
