// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/octomap/octomap_tree.hpp"

#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <sstream>

#include "mapcodec/cloud/occupancy_edit.hpp"

namespace mapcodec {
namespace {

template <class F>
auto guarded(F&& f) -> decltype(f()) {
  try {
    return f();
  } catch (const std::bad_alloc&) {
    return make_error(ErrorCode::kLimitExceeded, "out of memory in OctoMap");
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kMalformed, std::string("OctoMap: ") + e.what());
  }
}

ByteSpan bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// Through the streams that both sides have: OctoMap writes its nodes without a header and without a word.
template <class Tree>
Result<OctreeFile> from_tree(const Tree& tree, const char* id) {
  return guarded([&]() -> Result<OctreeFile> {
    std::ostringstream out;
    out << "# Octomap OcTree file\nid " << id << "\nsize " << tree.calcNumNodes() << "\nres 1\ndata\n";
    tree.writeData(out);
    const std::string text = out.str();
    MAPCODEC_ASSIGN(OctreeFile file, parse_octree(bytes_of(text)));
    file.resolution_m = tree.getResolution();
    return file;
  });
}

template <class Tree>
Result<std::unique_ptr<Tree>> to_tree(const OccupancyTree& tree, double resolution_m) {
  using Pointer = std::unique_ptr<Tree>;
  return guarded([&]() -> Result<Pointer> {
    auto r = std::make_unique<Tree>(resolution_m);
    if (tree.root == Cell::unknown) return Result<Pointer>(std::move(r));
    const Bytes bytes = format_octree(tree, resolution_m, OctreeFormat::ot);
    const std::string text(bytes.begin(), bytes.end());
    std::istringstream in(text.substr(text.find("\ndata\n") + 6));
    r->readData(in);
    return Result<Pointer>(std::move(r));
  });
}

/// OctoMap's points are float32.
octomap::point3d point_of(const Vec3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

std::optional<Vec3> origin_of(const MapInfo& info, std::uint32_t submap, const RaySettings& rays) {
  const bool posed = submap < info.submaps.size() && !info.submaps[submap].name.empty();
  return posed ? std::optional<Vec3>(info.submaps[submap].translation_m) : rays.origin_m;
}

/// One scan of each submap: within a scan OctoMap lets no ray empty a cell that another one hits.
class ScanInserter {
 public:
  ScanInserter(const MapInfo& info, const RaySettings& rays)
      : info_(info), rays_(rays), tree_(rays.resolution_m) {}

  void add(const PointCloud& cloud, std::uint32_t submap) {
    if (submap != submap_) flush();
    submap_ = submap;
    for (const Vec3& p : cloud.xyz) {
      if (is_finite(p)) scan_.push_back(point_of(p));
    }
  }

  octomap::OcTree& finish() {
    flush();
    tree_.updateInnerOccupancy();
    tree_.toMaxLikelihood();
    tree_.prune();
    return tree_;
  }

 private:
  void flush() {
    if (scan_.size() == 0) return;
    if (const auto origin = origin_of(info_, submap_, rays_)) {
      tree_.insertPointCloud(scan_, point_of(*origin), rays_.max_range_m, true, true);
    } else {
      for (const octomap::point3d& p : scan_) tree_.updateNode(p, true, true);
    }
    scan_.clear();
  }

  const MapInfo& info_;
  const RaySettings& rays_;
  octomap::OcTree tree_;
  octomap::Pointcloud scan_;
  std::uint32_t submap_ = 0;
};

}  // namespace

Result<OctreeFile> from_octomap(const octomap::OcTree& tree) {
  return from_tree(tree, "OcTree");
}
Result<OctreeFile> from_octomap(const octomap::ColorOcTree& tree) {
  return from_tree(tree, "ColorOcTree");
}

Result<std::unique_ptr<octomap::OcTree>> to_octomap(const OccupancyTree& tree, double resolution_m) {
  if (tree.kind != OccupancyKind::color) return to_tree<octomap::OcTree>(tree, resolution_m);
  OccupancyTree plain = tree;
  plain.kind = OccupancyKind::log_odds;
  for (OccupancyLevel& l : plain.levels) l.leaf_colors = l.node_colors = {};
  return to_tree<octomap::OcTree>(plain, resolution_m);
}

Result<std::unique_ptr<octomap::ColorOcTree>> to_color_octomap(const OccupancyTree& tree,
                                                               double resolution_m) {
  if (tree.kind != OccupancyKind::color)
    return make_error(ErrorCode::kInvalidArgument, "the octree has no colours");
  return to_tree<octomap::ColorOcTree>(tree, resolution_m);
}

Result<std::unique_ptr<octomap::OcTree>> read_octomap(const OccupancyMap& map, const Region& region,
                                                      const ReadSettings& settings) {
  MAPCODEC_ASSIGN(const OccupancyTree tree, map.read(region, settings));
  if (tree.root == Cell::unknown) return std::unique_ptr<octomap::OcTree>();
  return to_octomap(tree, map.resolution_m());
}

Status create_octomap(const std::string& path, const octomap::OcTree& tree, bool binary,
                      const OccupancyWrite& settings) {
  MAPCODEC_ASSIGN(const OctreeFile file, from_octomap(tree));
  return create_occupancy_map(path, binary ? to_binary(file.tree) : file.tree, file.resolution_m, settings);
}

Result<UpdateReport> update_octomap(const std::string& path, const octomap::OcTree& tree,
                                    const OccupancyWrite& settings) {
  MAPCODEC_ASSIGN(const OctreeFile file, from_octomap(tree));
  if (!tree.isChangeDetectionEnabled())
    return update_occupancy_map(path, file.tree, file.resolution_m, settings);
  std::vector<CellCorner> changed;
  for (auto it = tree.changedKeysBegin(); it != tree.changedKeysEnd(); ++it)
    changed.push_back({it->first[0], it->first[1], it->first[2]});
  return update_occupancy_map(path, file.tree, file.resolution_m, settings, &changed);
}

Result<OccupancyTree> insert_rays(const MapFile& map, const Region& region, const RaySettings& rays,
                                  const ReadSettings& settings) {
  return guarded([&]() -> Result<OccupancyTree> {
    ScanInserter scans(map.archive().info(), rays);
    for (const std::size_t i : map.tiles_in(region)) {
      if (settings.stop != nullptr && settings.stop->load())
        return make_error(ErrorCode::kCancelled, "interrupted");
      MAPCODEC_ASSIGN(PointCloud cloud, map.read_tile(i, settings.limits));
      if (!region.everything()) std::erase_if(cloud.xyz, [&](const Vec3& p) { return !region.contains(p); });
      scans.add(cloud, map.archive().tiles()[i].submap);
    }
    MAPCODEC_ASSIGN(const OctreeFile file, from_octomap(scans.finish()));
    return to_binary(file.tree);
  });
}

}  // namespace mapcodec
