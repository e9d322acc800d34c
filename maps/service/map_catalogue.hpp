// SPDX-License-Identifier: GPL-3.0-or-later
// What is known of maps beside their archives.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// What compaction keeps of a map.
struct Retention {
  std::uint64_t keep_last = 16;  ///< newest revisions beside those of snapshots; at least 1
};

/// The archives in the folder are what exists; a catalogue only adds to them: a map that it does not know has
/// the defaults. Threads: from many at once. Errors: CannotWrite, Unreadable.
class MapCatalogue {
 public:
  virtual ~MapCatalogue() = default;
  [[nodiscard]] virtual Status created(const std::string& map, const Retention& retention,
                                       const std::string& principal) = 0;
  [[nodiscard]] virtual Status removed(const std::string& map) = 0;
  [[nodiscard]] virtual Result<Retention> retention(const std::string& map) = 0;
  /// A job in the background. @param job  "compact". @param outcome  "begun", "done", or what went wrong.
  [[nodiscard]] virtual Status job(const std::string& map, const std::string& job,
                                   const std::string& outcome) = 0;
};

/// Forgets everything at the end of the program.
class MemoryCatalogue final : public MapCatalogue {
 public:
  [[nodiscard]] Status created(const std::string& map, const Retention& r, const std::string&) override {
    const std::lock_guard lock(mutex_);
    retention_[map] = r;
    return {};
  }
  [[nodiscard]] Status removed(const std::string& map) override {
    const std::lock_guard lock(mutex_);
    retention_.erase(map);
    return {};
  }
  [[nodiscard]] Result<Retention> retention(const std::string& map) override {
    const std::lock_guard lock(mutex_);
    const auto at = retention_.find(map);
    return at == retention_.end() ? Retention{} : at->second;
  }
  [[nodiscard]] Status job(const std::string&, const std::string&, const std::string&) override { return {}; }

 private:
  std::mutex mutex_;
  std::map<std::string, Retention> retention_;
};

}  // namespace mapcodec
