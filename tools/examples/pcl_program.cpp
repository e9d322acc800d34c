// SPDX-License-Identifier: GPL-3.0-or-later
// A program that uses PCL, and our maps: a box of a map as a coloured cloud of PCL's, worked on with PCL's
// filter and search, and written back as a map.
//   pcl_program MAP.mapc x0 y0 z0 x1 y1 z1 OUT.mapc
#include <pcl/filters/voxel_grid.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>

#include <cstdio>
#include <cstdlib>

#include "mapcodec/mapcodec.hpp"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZRGB>;

/// Relative to `origin`: PCL's points are float32.
Cloud::Ptr to_pcl(const mapcodec::PointCloud& points, const mapcodec::Vec3& origin) {
  auto cloud = std::make_shared<Cloud>();
  const mapcodec::Channel* rgb = points.find("rgb");
  const bool bytes = rgb != nullptr && rgb->info.type_name() == "u8x3";
  for (std::size_t i = 0; i < points.size(); ++i) {
    pcl::PointXYZRGB p;
    p.x = float(points.xyz[i][0] - origin[0]);
    p.y = float(points.xyz[i][1] - origin[1]);
    p.z = float(points.xyz[i][2] - origin[2]);
    p.r = bytes ? rgb->get<std::uint8_t>(i, 0) : 255;
    p.g = bytes ? rgb->get<std::uint8_t>(i, 1) : 255;
    p.b = bytes ? rgb->get<std::uint8_t>(i, 2) : 255;
    cloud->push_back(p);
  }
  return cloud;
}

mapcodec::PointCloud from_pcl(const Cloud& cloud, const mapcodec::Vec3& origin) {
  mapcodec::PointCloud points;
  mapcodec::Channel rgb;
  rgb.info = mapcodec::ChannelInfo{"rgb", mapcodec::ScalarType::u8, 3};
  rgb.data.resize(3 * cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto& p = cloud[i];
    points.xyz.push_back({double(p.x) + origin[0], double(p.y) + origin[1], double(p.z) + origin[2]});
    rgb.set(i, p.r, 0);
    rgb.set(i, p.g, 1);
    rgb.set(i, p.b, 2);
  }
  points.channels.push_back(std::move(rgb));
  return points;
}

mapcodec::Status work(const char* in, const mapcodec::Box& box, const char* out) {
  MAPCODEC_ASSIGN(const mapcodec::MapFile map, mapcodec::MapFile::open(in));
  mapcodec::Region region;
  region.box = box;
  MAPCODEC_ASSIGN(const mapcodec::PointCloud part, map.read(region));  // only the tiles that meet the box
  if (part.empty()) return make_error(mapcodec::ErrorCode::kEmpty, "no point lies in the box");
  const Cloud::Ptr cloud = to_pcl(part, box.min);

  pcl::VoxelGrid<pcl::PointXYZRGB> grid;
  grid.setInputCloud(cloud);
  grid.setLeafSize(0.05F, 0.05F, 0.05F);
  Cloud::Ptr thin = std::make_shared<Cloud>();
  grid.filter(*thin);
  pcl::KdTreeFLANN<pcl::PointXYZRGB> tree;
  tree.setInputCloud(thin);
  std::vector<int> index(1);
  std::vector<float> squared(1);
  tree.nearestKSearch(cloud->front(), 1, index, squared);
  std::printf("points %zu\nthinned %zu\nnearest_m %.4f\n", cloud->size(), thin->size(),
              std::sqrt(double(squared[0])));

  mapcodec::CompressOptions options;
  options.promise = mapcodec::PromiseKind::max_error;
  options.promise_m = 0.002;
  options.overwrite = true;
  return [&]() -> mapcodec::Status {
    MAPCODEC_ASSIGN(const auto report, mapcodec::write_map(from_pcl(*thin, box.min), out, options));
    std::printf("written %zu\n", std::size_t(report.points));
    return {};
  }();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 9) return 2;
  mapcodec::Box box;
  for (std::size_t d = 0; d < 3; ++d) {
    box.min[d] = std::atof(argv[2 + d]);
    box.max[d] = std::atof(argv[5 + d]);
  }
  const mapcodec::Status s = work(argv[1], box, argv[8]);
  if (s.ok()) return 0;
  std::fprintf(stderr, "pcl_program: %s\n", s.error().to_string().c_str());
  return 1;
}
