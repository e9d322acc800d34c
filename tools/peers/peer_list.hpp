// SPDX-License-Identifier: GPL-3.0-or-later
// Where the sources of this folder meet; the first two exist only where the packages were found.
#pragma once

#include "tools/peers/peers.hpp"

namespace mapcodec::peers {

void add_draco(std::vector<Peer>& to);
void add_pcl(std::vector<Peer>& to);
void add_zstd(std::vector<Peer>& to);

}  // namespace mapcodec::peers
