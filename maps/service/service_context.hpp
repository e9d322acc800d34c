// SPDX-License-Identifier: GPL-3.0-or-later
// What all maps of a service share.
#pragma once

#include <atomic>

#include "maps/service/map_service.hpp"
#include "maps/service/segment_cache.hpp"

namespace mapcodec {

struct ServiceContext {
  ServiceContext(const ServiceSettings& s, MapCoding& c, MapCatalogue& k, ServiceMetrics& m)
      : settings(s), coding(c), catalogue(k), metrics(m), cache(s.cache_bytes) {}

  const ServiceSettings settings;
  MapCoding& coding;
  MapCatalogue& catalogue;
  ServiceMetrics& metrics;
  SegmentCache cache;
  std::atomic<std::uint64_t> queued_points{0}, queued_scans{0};
  std::atomic<std::uint64_t> editors{0}, watchers{0}, compacting{0};
  std::atomic<double> points_per_second{1e6};  ///< of the last commits
  std::atomic<bool> draining{false};
  std::atomic<std::uint64_t> next_file{1};  ///< numbers for files; see MapView::file
};

}  // namespace mapcodec
