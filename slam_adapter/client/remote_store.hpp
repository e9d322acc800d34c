// SPDX-License-Identifier: GPL-3.0-or-later
// The archive of a map on a service, read as if it lay here.
#pragma once

#include "maps/tile_store.hpp"
#include "slam_adapter/client/map_client.hpp"

namespace mapcodec {

/// Reads ranges of the server's file; small ones come in blocks that are kept for a while. All ranges are of
/// one file, also if the server compacts the map meanwhile (for some minutes).
/// Errors: as MapClient.
[[nodiscard]] Result<std::unique_ptr<TileStore>> open_remote_store(const MapClient& client);

/// From now on everything that opens maps takes mapcodec://HOST:PORT/MAP, too (store_schemes.hpp).
void register_map_scheme();

}  // namespace mapcodec
