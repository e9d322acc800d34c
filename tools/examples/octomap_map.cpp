// SPDX-License-Identifier: GPL-3.0-or-later
// How an OctoMap program uses an archive: store a tree, bring the archive up to date from the changed keys,
// ask for a box. Usage: octomap_map MAP.mapc [IN.bt]   Prints one line of figures; exit code 1 if the archive
// and the tree differ.
#include <octomap/octomap.h>

#include <cmath>
#include <cstdio>

#include "slam_adapter/octomap/octomap_tree.hpp"

namespace {

using namespace mapcodec;

int fail(const Error& e) {
  std::fprintf(stderr, "octomap_map: %s\n", e.to_string().c_str());
  return 2;
}

/// What a range finder at the origin of a bumpy hall sees.
octomap::Pointcloud scan_of_hall(double shift) {
  octomap::Pointcloud scan;
  for (int i = 0; i < 360; ++i) {
    for (int k = -20; k <= 20; ++k) {
      const double a = i * 0.0174533, b = k * 0.02, r = 4 + 0.3 * std::sin(5 * a + shift);
      scan.push_back(static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)),
                     static_cast<float>(r * b));
    }
  }
  return scan;
}

/// Leaves of `part` that the whole tree has not exactly so.
std::size_t count_wrong(const octomap::OcTree& part, const octomap::OcTree& whole) {
  std::size_t wrong = 0;
  for (auto it = part.begin_leafs(); it != part.end_leafs(); ++it) {
    const octomap::OcTreeNode* node = whole.search(it.getKey(), it.getDepth());
    wrong += node == nullptr || node->getLogOdds() != it->getLogOdds() ? 1 : 0;
  }
  return wrong;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  octomap::OcTree tree(0.1);
  if (argc > 2 && !tree.readBinary(argv[2])) return 2;
  if (argc == 2) tree.insertPointCloud(scan_of_hall(0), octomap::point3d(0, 0, 0));

  OccupancyWrite write;
  write.overwrite = true;
  if (const Status s = create_octomap(argv[1], tree, false, write); !s.ok()) return fail(s.error());

  tree.enableChangeDetection(true);
  tree.insertPointCloud(scan_of_hall(0.2), octomap::point3d(0.5F, 0, 0), 5);
  const auto update = update_octomap(argv[1], tree, write);
  if (!update.ok()) return fail(update.error());
  const std::size_t changed = tree.numChangesDetected();
  tree.resetChangeDetection();

  const auto map = OccupancyMap::open(argv[1]);
  if (!map.ok()) return fail(map.error());
  Region region;
  region.box = Box{{0, 0, -0.5}, {5, 5, 0.5}};
  const auto part = read_octomap(*map, region);
  if (!part.ok()) return fail(part.error());
  const auto whole = read_octomap(*map, {});
  if (!whole.ok()) return fail(whole.error());
  if (*part == nullptr || *whole == nullptr) return 1;
  const std::size_t wrong = count_wrong(**part, tree) + count_wrong(**whole, tree);
  const bool same = (*whole)->getNumLeafNodes() == tree.getNumLeafNodes() && (*whole)->size() == tree.size();
  std::printf("leaves %zu changed_keys %zu tiles_touched %llu box_leaves %zu wrong %zu\n",
              tree.getNumLeafNodes(), changed, static_cast<unsigned long long>(update->tiles_touched),
              (*part)->getNumLeafNodes(), wrong);
  return wrong == 0 && same ? 0 : 1;
}
