// SPDX-License-Identifier: GPL-3.0-or-later
// A LocalMap as MRPT's programs know maps: for CICP, for particle filters, for questions about neighbours.
//
//   auto map = LocalMap::open("city.mapc", {.radius_m = 50}, arena);
//   map->move_to(T_map_robot); map->wait_ready(1);
//   LocalMetricMap reference(map->view());
//   auto pose = icp.AlignPDF(&reference, &scan_points, guess, info);
#pragma once

#include <mrpt/maps/CMetricMap.h>

#include <memory>
#include <vector>

#include "slam_adapter/local_map.hpp"

namespace mapcodec {

/// Read-only: insertions are refused, `clear` lets go of the view. Distances are between points [m, map
/// frame]. Threads: const methods from many at once.
class LocalMetricMap final : public mrpt::maps::CMetricMap {
  DEFINE_SERIALIZABLE(LocalMetricMap, mapcodec)

 public:
  struct LikelihoodOptions {
    double sigma_m = 0.1;         ///< of a point's distance to its nearest neighbour
    double farthest_m = 0.5;      ///< a larger distance counts as this one
    std::size_t decimation = 10;  ///< of the scan's points
  };
  LikelihoodOptions likelihood_options;

  LocalMetricMap() = default;
  explicit LocalMetricMap(std::shared_ptr<const LocalMapView> view) : view_(std::move(view)) {}
  /// The newer view of a map that has moved.
  void set_view(std::shared_ptr<const LocalMapView> view) { view_ = std::move(view); }

  /// The nearest point; false if there is none within `radius_m`.
  bool nearest(const mrpt::math::TPoint3Df& query, double radius_m, mrpt::math::TPoint3Df& point,
               float& squared_distance) const;
  /// Mean log-likelihood of points [m, vehicle frame] seen from here (a likelihood field: Thrun, Burgard, Fox
  /// 2005, 6.4).
  [[nodiscard]] double log_likelihood(const std::vector<mrpt::math::TPoint3Df>& points,
                                      const mrpt::poses::CPose3D& T_map_vehicle) const;

  [[nodiscard]] bool isEmpty() const override { return !view_ || view_->points() == 0; }
  void determineMatching2D(const mrpt::maps::CMetricMap* other, const mrpt::poses::CPose2D& pose_of_other,
                           mrpt::tfest::TMatchingPairList& pairs, const mrpt::maps::TMatchingParams& params,
                           mrpt::maps::TMatchingExtraResults& extra) const override;
  void determineMatching3D(const mrpt::maps::CMetricMap* other, const mrpt::poses::CPose3D& pose_of_other,
                           mrpt::tfest::TMatchingPairList& pairs, const mrpt::maps::TMatchingParams& params,
                           mrpt::maps::TMatchingExtraResults& extra) const override;
  float compute3DMatchingRatio(const mrpt::maps::CMetricMap* other, const mrpt::poses::CPose3D& pose_of_other,
                               const mrpt::maps::TMatchingRatioParams& params) const override;
  float squareDistanceToClosestCorrespondence(float x, float y) const override;
  void saveMetricMapRepresentationToFile(const std::string& prefix) const override;
  void getVisualizationInto(mrpt::opengl::CSetOfObjects& out) const override;
  [[nodiscard]] std::string asString() const override { return "mapcodec LocalMap"; }

 private:
  void internal_clear() override { view_.reset(); }
  bool internal_insertObservation(const mrpt::obs::CObservation& o,
                                  const std::optional<const mrpt::poses::CPose3D>& pose) override;
  double internal_computeObservationLikelihood(const mrpt::obs::CObservation& o,
                                               const mrpt::poses::CPose3D& taken_from) const override;
  bool internal_canComputeObservationLikelihood(const mrpt::obs::CObservation& o) const override;

  std::shared_ptr<const LocalMapView> view_;
};

}  // namespace mapcodec
