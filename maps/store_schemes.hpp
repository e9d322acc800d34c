// SPDX-License-Identifier: GPL-3.0-or-later
// Archives that lie elsewhere than in a file: whoever can open "scheme://..." says so once.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "maps/tile_store.hpp"

namespace mapcodec {

using StoreOpener = std::function<Result<std::unique_ptr<TileStore>>(const std::string& place)>;

/// From now on MapArchive::open, and all that opens maps through it, takes places that begin with `prefix`.
/// Threads: before others open maps.
void register_store_scheme(const std::string& prefix, StoreOpener opener);
/// Whether `place` begins with a registered prefix.
[[nodiscard]] bool has_store_scheme(const std::string& place);
/// For reading: by the opener of its prefix, else as a file. Errors: the opener's; FileStore's.
[[nodiscard]] Result<std::unique_ptr<TileStore>> open_store(const std::string& place);

}  // namespace mapcodec
