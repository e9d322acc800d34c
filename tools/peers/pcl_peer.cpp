// SPDX-License-Identifier: GPL-3.0-or-later
// What PCL offers: its octree codec, and the two reductions that the 2014 paper compares itself with.
#define PCL_NO_PRECOMPILE
#include <pcl/compression/octree_pointcloud_compression.h>
#include <pcl/octree/octree_pointcloud_pointvector.h>
#include <pcl/octree/octree_pointcloud_voxelcentroid.h>
#include <pcl/point_types.h>
#include <pcl/io/impl/entropy_range_coder.hpp>
#include <pcl/io/impl/octree_pointcloud_compression.hpp>

#include <sstream>

#include "tools/peers/grid.hpp"
#include "tools/peers/peer_list.hpp"

namespace mapcodec::peers {
namespace {

using Point = pcl::PointXYZ;
using Cloud = pcl::PointCloud<Point>;
constexpr std::uint64_t kFloatPointBytes = 12;

/// PCL's points are float32: without the corner, large coordinates would lose their millimetres before it
/// starts.
Cloud::Ptr to_pcl(const std::vector<Vec3>& points, const Vec3& corner) {
  auto cloud = pcl::make_shared<Cloud>();
  cloud->reserve(points.size());
  for (const Vec3& p : points) {
    cloud->push_back({float(p[0] - corner[0]), float(p[1] - corner[1]), float(p[2] - corner[2])});
  }
  return cloud;
}

template <class Points>
std::vector<Vec3> from_pcl(const Points& points, const Vec3& corner) {
  std::vector<Vec3> r;
  r.reserve(points.size());
  for (const Point& p : points) r.push_back({corner[0] + p.x, corner[1] + p.y, corner[2] + p.z});
  return r;
}

Vec3 corner_of(const std::vector<Vec3>& points) {
  Box box;
  for (const Vec3& p : points) box.add(p);
  return box.min;
}

void encode_octree(const Cloud::ConstPtr& cloud, double step_m, std::ostream& to) {
  pcl::io::OctreePointCloudCompression<Point> encoder(pcl::io::MANUAL_CONFIGURATION, false, step_m, step_m,
                                                      true, 1, false);
  encoder.encodePointCloud(cloud, to);
}

PeerRun octree_codec(const std::vector<Vec3>& points, double step_m) {
  const Vec3 corner = corner_of(points);
  const Cloud::Ptr cloud = to_pcl(points, corner);
  PeerRun run;
  std::stringstream stream;
  const StopWatch encoding;
  encode_octree(cloud, step_m, stream);
  run.encode_seconds = encoding.seconds();
  run.bytes = stream.str().size();

  const StopWatch decoding;
  pcl::io::OctreePointCloudCompression<Point> decoder;
  Cloud::Ptr decoded = pcl::make_shared<Cloud>();
  decoder.decodePointCloud(stream, decoded);
  run.decode_seconds = decoding.seconds();
  run.decoded = from_pcl(*decoded, corner);
  return run;
}

/// The centre of each occupied voxel, as floats.
PeerRun octree_centres(const std::vector<Vec3>& points, double step_m) {
  const Vec3 corner = corner_of(points);
  const Cloud::Ptr cloud = to_pcl(points, corner);
  PeerRun run;
  const StopWatch encoding;
  pcl::octree::OctreePointCloudPointVector<Point> tree(step_m);
  tree.setInputCloud(cloud);
  tree.addPointsFromInputCloud();
  pcl::octree::OctreePointCloudPointVector<Point>::AlignedPointTVector centres;
  tree.getOccupiedVoxelCenters(centres);
  run.encode_seconds = encoding.seconds();
  run.bytes = kFloatPointBytes * centres.size();
  run.decoded = from_pcl(centres, corner);
  return run;
}

/// The mean of the points in each occupied voxel, as floats. PCL's octree does it: its VoxelGrid counts
/// voxels in 32 bits and gives up on large clouds.
PeerRun voxel_centroids(const std::vector<Vec3>& points, double step_m) {
  const Vec3 corner = corner_of(points);
  const Cloud::Ptr cloud = to_pcl(points, corner);
  PeerRun run;
  const StopWatch encoding;
  pcl::octree::OctreePointCloudVoxelCentroid<Point> tree(step_m);
  tree.setInputCloud(cloud);
  tree.addPointsFromInputCloud();
  pcl::octree::OctreePointCloudVoxelCentroid<Point>::AlignedPointTVector centroids;
  tree.getVoxelCentroids(centroids);
  run.encode_seconds = encoding.seconds();
  run.bytes = kFloatPointBytes * centroids.size();
  run.decoded = from_pcl(centroids, corner);
  return run;
}

template <class Work>
Peer guarded(std::string name, Work work) {
  return {std::move(name), false, false,
          [work](const std::vector<Vec3>& points, double step_m) -> Result<PeerRun> {
            try {
              return work(points, step_m);
            } catch (const std::exception& e) {
              return make_error(ErrorCode::kUnsupported, std::string("PCL: ") + e.what());
            }
          }};
}

}  // namespace

void add_pcl(std::vector<Peer>& to) {
  to.push_back(guarded("pcl-octree-voxel", octree_codec));
  to.push_back(guarded("pcl-octree-centres", octree_centres));
  to.push_back(guarded("pcl-voxelgrid", voxel_centroids));
}

}  // namespace mapcodec::peers
