// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/peers/peers.hpp"

#include "tools/peers/peer_list.hpp"

namespace mapcodec::peers {

std::vector<Peer> available_peers() {
  std::vector<Peer> list;
#ifdef MAPCODEC_PEER_DRACO
  add_draco(list);
#endif
#ifdef MAPCODEC_PEER_PCL
  add_pcl(list);
#endif
  add_zstd(list);
  return list;
}

std::vector<std::string> absent_peers() {
  std::vector<std::string> list;
#ifndef MAPCODEC_PEER_DRACO
  list.emplace_back("draco");
#endif
#ifndef MAPCODEC_PEER_PCL
  list.insert(list.end(), {"pcl-octree-voxel", "pcl-octree-centres", "pcl-voxelgrid"});
#endif
  return list;
}

}  // namespace mapcodec::peers
