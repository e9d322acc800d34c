// SPDX-License-Identifier: GPL-3.0-or-later
// One map of the service as its readers see it.
#pragma once

#include <chrono>
#include <list>
#include <mutex>

#include "maps/service/service_context.hpp"

namespace mapcodec {

/// Opens each revision once, when somebody asks for it. Threads: from many at once.
class MapReader {
 public:
  MapReader(std::string name, std::string path, ServiceContext& context)
      : name_(std::move(name)), path_(std::move(path)), context_(context) {}

  /// @param own_writer  the service holds the archive's lock: nobody else changes it, so that only `changed`
  /// says when it has to be looked at.
  [[nodiscard]] Result<MapViewPtr> newest(bool own_writer);
  [[nodiscard]] Result<MapViewPtr> at(const MapViewPtr& newest, const std::string& revision);
  [[nodiscard]] Result<MapViewPtr> of_file(std::uint64_t file);
  /// The archive has a new revision, or a new file.
  void changed();
  /// The archive is no more.
  void close();
  /// Lets go of files that were replaced some minutes ago.
  void forget_old_files();
  /// The newest that somebody opened; may be nullptr.
  [[nodiscard]] MapViewPtr last_opened() const;

 private:
  struct Look {
    std::uint64_t inode = 0, bytes = 0;
    std::int64_t changed_ns = 0;
    bool operator==(const Look&) const = default;
  };
  struct Replaced {
    MapViewPtr view;
    std::chrono::steady_clock::time_point since;
  };

  [[nodiscard]] Look look() const;
  [[nodiscard]] Result<MapViewPtr> open();

  const std::string name_, path_;
  ServiceContext& context_;
  mutable std::mutex mutex_;
  bool changed_ = true, closed_ = false;
  Look seen_;
  MapViewPtr view_;
  std::list<Replaced> replaced_;
  std::list<MapViewPtr> revisions_;  // older ones that were asked for lately, of the file of view_
};

}  // namespace mapcodec
