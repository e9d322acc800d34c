// SPDX-License-Identifier: GPL-3.0-or-later
// The last scan of each writer that is in a map, kept with the map: a scan that is sent again after a broken
// connection or a killed daemon counts once.
#pragma once

#include <cstdint>
#include <list>
#include <string>

#include "mapcodec/base/result.hpp"
#include "maps/map_types.hpp"

namespace mapcodec {

/// Key in MapInfo::extras (FORMAT.md, Extras).
inline constexpr const char* kWritersExtra = "writers";
inline constexpr std::size_t kMaxWriters = 256;
inline constexpr std::size_t kMaxWriterName = 64;

class WriterTable {
 public:
  /// What is not readable is taken for empty: then scans may count twice, and nothing is lost.
  [[nodiscard]] static WriterTable read(const MapInfo& info);
  [[nodiscard]] Bytes write() const;

  /// 0: none.
  [[nodiscard]] std::uint64_t last(const std::string& writer) const;
  /// The writer whose last scan is the oldest is forgotten if there are too many.
  void set(const std::string& writer, std::uint64_t sequence);

 private:
  struct Entry {
    std::string writer;
    std::uint64_t sequence = 0;
  };
  std::list<Entry> entries_;  // the one that was set last comes last
};

}  // namespace mapcodec
