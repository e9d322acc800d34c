// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/cylinders_ransac.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Random.h>
#include <CGAL/Shape_detection/Efficient_RANSAC.h>
#include <CGAL/property_map.h>

#include <exception>
#include <new>

namespace mapcodec {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Oriented = std::pair<Kernel::Point_3, Kernel::Vector_3>;
using Points = std::vector<Oriented>;
using Traits =
    CGAL::Shape_detection::Efficient_RANSAC_traits<Kernel, Points, CGAL::First_of_pair_property_map<Oriented>,
                                                   CGAL::Second_of_pair_property_map<Oriented>>;
using Ransac = CGAL::Shape_detection::Efficient_RANSAC<Traits>;
using Cylinder = CGAL::Shape_detection::Cylinder<Traits>;

RansacCylinder plain(const Cylinder& c, const Vec3& origin) {
  RansacCylinder r;
  const auto line = c.axis();
  const auto on = line.projection(CGAL::ORIGIN);
  auto direction = line.to_vector();
  direction = direction / std::sqrt(direction.squared_length());
  for (int d = 0; d < 3; ++d) {
    r.on_axis[std::size_t(d)] = on[d] + origin[std::size_t(d)];
    r.axis[std::size_t(d)] = direction[d];
  }
  r.radius_m = c.radius();
  for (const std::size_t i : c.indices_of_assigned_points()) r.points.push_back(std::uint32_t(i));
  return r;
}

std::vector<RansacCylinder> detect(const std::vector<Vec3>& xyz, const std::vector<Vec3>& normals,
                                   const RansacSettings& s) {
  // Near the origin, whatever the map's frame.
  const Vec3 origin = xyz.front();
  Points points;
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    points.emplace_back(Kernel::Point_3(xyz[i][0] - origin[0], xyz[i][1] - origin[1], xyz[i][2] - origin[2]),
                        Kernel::Vector_3(normals[i][0], normals[i][1], normals[i][2]));
  }
  CGAL::get_default_random() = CGAL::Random(s.seed);
  Ransac ransac;
  ransac.set_input(points);
  ransac.add_shape_factory<CGAL::Shape_detection::Plane<Traits>>();
  ransac.add_shape_factory<Cylinder>();
  Ransac::Parameters p;
  p.probability = s.miss_probability;
  p.min_points = s.least_points;
  p.epsilon = s.distance_m;
  p.cluster_epsilon = s.cluster_m;
  p.normal_threshold = s.normal_cosine;
  ransac.detect(p);
  std::vector<RansacCylinder> found;
  for (const auto& shape : ransac.shapes()) {
    const auto* cylinder = dynamic_cast<const Cylinder*>(shape.get());
    if (cylinder != nullptr) found.push_back(plain(*cylinder, origin));
  }
  return found;
}

}  // namespace

Result<std::vector<RansacCylinder>> ransac_cylinders(const std::vector<Vec3>& points,
                                                     const std::vector<Vec3>& normals,
                                                     const RansacSettings& settings) {
  if (points.size() < settings.least_points || points.empty()) return std::vector<RansacCylinder>{};
  try {
    return detect(points, normals, settings);
  } catch (const std::bad_alloc&) {
    return make_error(ErrorCode::kLimitExceeded, "cylinders: not enough memory");
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kInvalidArgument, std::string("cylinders: ") + e.what());
  }
}

}  // namespace mapcodec
