// SPDX-License-Identifier: GPL-3.0-or-later
// The list of a map's tiles as JSON, made once per revision.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "maps/service/map_service.hpp"

namespace mapcodec::daemon {

struct MapIndex {
  std::string text;  ///< JSON
  std::string etag;  ///< quoted
};

/// Threads: from many at once; one makes a text while those who want it, too, wait.
class MapIndexes {
 public:
  [[nodiscard]] std::shared_ptr<const MapIndex> index(const MapView& view);

 private:
  struct Entry {
    std::string map;
    std::uint64_t file = 0, revision = 0;
    std::shared_ptr<const MapIndex> index;
  };
  std::mutex mutex_;
  std::list<Entry> entries_;  ///< the last used first
};

}  // namespace mapcodec::daemon
