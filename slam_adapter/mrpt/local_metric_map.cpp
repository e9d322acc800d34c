// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/local_metric_map.hpp"

#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservation.h>
#include <mrpt/opengl/CPointCloud.h>
#include <mrpt/opengl/CSetOfObjects.h>
#include <mrpt/poses/CPose2D.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/tfest/TMatchingPair.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>

#include "slam_adapter/mrpt/observation_points.hpp"

IMPLEMENTS_SERIALIZABLE(LocalMetricMap, CMetricMap, mapcodec)

namespace mapcodec {
namespace {

using mrpt::math::TPoint3Df;
using mrpt::poses::CPose3D;

/// Every `step`th point of a map of MRPT's, moved.
template <class F>
std::size_t each_point(const mrpt::maps::CMetricMap* other, const CPose3D& pose, std::size_t begin,
                       std::size_t step, F&& f) {
  const auto* points = dynamic_cast<const mrpt::maps::CPointsMap*>(other);
  if (points == nullptr) points = other != nullptr ? other->getAsSimplePointsMap() : nullptr;
  if (points == nullptr) throw std::runtime_error("a LocalMetricMap is matched with points maps only");
  std::size_t asked = 0;
  for (std::size_t i = begin; i < points->size(); i += std::max<std::size_t>(1, step), ++asked) {
    float x, y, z;
    points->getPointFast(i, x, y, z);
    double gx, gy, gz;
    pose.composePoint(double(x), double(y), double(z), gx, gy, gz);
    f(i, TPoint3Df(x, y, z), Vec3{gx, gy, gz});
  }
  return asked;
}

/// A number for a point of a view that stays the same within it.
mrpt::tfest::TMatchingPair pair_of(const LocalMapView& view, const LocalNeighbor& n, std::size_t index,
                                   const TPoint3Df& local) {
  const Vec3 p = view.point(n);
  mrpt::tfest::TMatchingPair pair;
  pair.globalIdx = n.index;
  pair.localIdx = static_cast<std::uint32_t>(index);
  pair.global = TPoint3Df(float(p[0]), float(p[1]), float(p[2]));
  pair.local = local;
  pair.errorSquareAfterTransformation = float(n.distance_m * n.distance_m);
  return pair;
}

/// Of the pairs that share a point of the map, the closest.
void keep_closest(mrpt::tfest::TMatchingPairList& pairs, const std::vector<std::uint64_t>& partner) {
  std::map<std::uint64_t, std::size_t> best;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto [at, fresh] = best.try_emplace(partner[i], i);
    if (!fresh && pairs[i].errorSquareAfterTransformation < pairs[at->second].errorSquareAfterTransformation)
      at->second = i;
  }
  mrpt::tfest::TMatchingPairList kept;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (best[partner[i]] == i) kept.push_back(pairs[i]);
  }
  pairs = std::move(kept);
}

/// Points of an observation [m, vehicle frame]; none if it gives none.
std::vector<TPoint3Df> points_of(const mrpt::obs::CObservation& o) {
  RawlogFrame frame;
  std::vector<TPoint3Df> points;
  // Some of MRPT's observations load or make their points when asked.
  const auto copy = std::dynamic_pointer_cast<mrpt::obs::CObservation>(o.duplicateGetSmartPtr());
  if (!copy || !take_points(*copy, {}, frame).empty()) return points;
  for (const Vec3& p : frame.points.xyz) points.emplace_back(float(p[0]), float(p[1]), float(p[2]));
  return points;
}

}  // namespace

bool LocalMetricMap::nearest(const TPoint3Df& query, double radius_m, TPoint3Df& point,
                             float& squared) const {
  if (!view_) return false;
  const auto found = view_->nearest({double(query.x), double(query.y), double(query.z)}, 1, radius_m);
  if (found.empty()) return false;
  const Vec3 p = view_->point(found[0]);
  point = TPoint3Df(float(p[0]), float(p[1]), float(p[2]));
  squared = float(found[0].distance_m * found[0].distance_m);
  return true;
}

double LocalMetricMap::log_likelihood(const std::vector<TPoint3Df>& points, const CPose3D& pose) const {
  const LikelihoodOptions& o = likelihood_options;
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < points.size(); i += std::max<std::size_t>(1, o.decimation)) {
    Vec3 p{0, 0, 0};
    pose.composePoint(double(points[i].x), double(points[i].y), double(points[i].z), p[0], p[1], p[2]);
    const auto found = view_ ? view_->nearest(p, 1, o.farthest_m) : std::vector<LocalNeighbor>{};
    const double d = found.empty() ? o.farthest_m : found[0].distance_m;
    sum -= 0.5 * d * d / (o.sigma_m * o.sigma_m);
    count += 1;
  }
  return count > 0 ? sum / count : 0;
}

void LocalMetricMap::determineMatching2D(const mrpt::maps::CMetricMap* other,
                                         const mrpt::poses::CPose2D& pose,
                                         mrpt::tfest::TMatchingPairList& pairs,
                                         const mrpt::maps::TMatchingParams& params,
                                         mrpt::maps::TMatchingExtraResults& extra) const {
  determineMatching3D(other, CPose3D(pose), pairs, params, extra);
}

void LocalMetricMap::determineMatching3D(const mrpt::maps::CMetricMap* other, const CPose3D& pose,
                                         mrpt::tfest::TMatchingPairList& pairs,
                                         const mrpt::maps::TMatchingParams& params,
                                         mrpt::maps::TMatchingExtraResults& extra) const {
  pairs.clear();
  extra = {};
  if (!view_) return;
  std::vector<std::uint64_t> partner;
  double squares = 0;
  const auto match = [&](std::size_t i, const TPoint3Df& local, const Vec3& p) {
    const mrpt::math::TPoint3D at(p[0], p[1], p[2]);
    const double reach =
        double(params.maxDistForCorrespondence) +
        double(params.maxAngularDistForCorrespondence) * (at - params.angularDistPivotPoint).norm();
    const auto found = view_->nearest(p, 1, reach);
    if (found.empty()) return;
    pairs.push_back(pair_of(*view_, found[0], i, local));
    partner.push_back((std::uint64_t{found[0].tile} << 32) | found[0].index);
    squares += found[0].distance_m * found[0].distance_m;
  };
  const std::size_t asked =
      each_point(other, pose, params.offset_other_map_points, params.decimation_other_map_points, match);
  if (asked > 0) extra.correspondencesRatio = float(double(pairs.size()) / double(asked));
  if (!pairs.empty()) extra.sumSqrDist = float(squares / double(pairs.size()));
  if (params.onlyUniqueRobust) keep_closest(pairs, partner);
}

float LocalMetricMap::compute3DMatchingRatio(const mrpt::maps::CMetricMap* other, const CPose3D& pose,
                                             const mrpt::maps::TMatchingRatioParams& params) const {
  if (!view_) return 0;
  std::size_t matched = 0;
  const std::size_t asked = each_point(other, pose, 0, 1, [&](std::size_t, const TPoint3Df&, const Vec3& p) {
    matched += view_->nearest(p, 1, double(params.maxDistForCorr)).empty() ? 0 : 1;
  });
  return asked > 0 ? float(double(matched) / double(asked)) : 0;
}

float LocalMetricMap::squareDistanceToClosestCorrespondence(float x, float y) const {
  TPoint3Df point;
  float squared = 0;
  return nearest(TPoint3Df(x, y, 0), INFINITY, point, squared) ? squared : std::numeric_limits<float>::max();
}

void LocalMetricMap::saveMetricMapRepresentationToFile(const std::string& prefix) const {
  std::ofstream out(prefix + "_points.txt");
  if (!view_) return;
  for (const Vec3& p : view_->cloud().xyz) out << p[0] << ' ' << p[1] << ' ' << p[2] << '\n';
}

void LocalMetricMap::getVisualizationInto(mrpt::opengl::CSetOfObjects& out) const {
  if (!view_) return;
  auto points = mrpt::opengl::CPointCloud::Create();
  for (const Vec3& p : view_->cloud().xyz) points->insertPoint(float(p[0]), float(p[1]), float(p[2]));
  out.insert(points);
}

bool LocalMetricMap::internal_insertObservation(const mrpt::obs::CObservation&,
                                                const std::optional<const CPose3D>&) {
  return false;
}

double LocalMetricMap::internal_computeObservationLikelihood(const mrpt::obs::CObservation& o,
                                                             const CPose3D& taken_from) const {
  return log_likelihood(points_of(o), taken_from);
}

bool LocalMetricMap::internal_canComputeObservationLikelihood(const mrpt::obs::CObservation& o) const {
  return gives_points(o);
}

uint8_t LocalMetricMap::serializeGetVersion() const {
  return 0;
}
void LocalMetricMap::serializeTo(mrpt::serialization::CArchive&) const {
  throw std::runtime_error("a LocalMetricMap is a view of a map file: keep that");
}
void LocalMetricMap::serializeFrom(mrpt::serialization::CArchive&, uint8_t) {
  throw std::runtime_error("a LocalMetricMap is a view of a map file: open that");
}

}  // namespace mapcodec
