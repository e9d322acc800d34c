// SPDX-License-Identifier: GPL-3.0-or-later
// Those who want to know when a map changes.
#pragma once

#include <functional>
#include <list>
#include <memory>
#include <mutex>

#include "maps/service/map_service.hpp"

namespace mapcodec {

/// Calls until it is destroyed, and is destroyed only between two calls.
class MapService::Watcher {
 public:
  Watcher(std::function<void()> changed, std::function<void()> gone)
      : changed_(std::move(changed)), gone_(std::move(gone)) {}
  ~Watcher() { gone_(); }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

 private:
  friend class WatchList;
  std::function<void()> changed_, gone_;
};

/// Threads: from many at once.
class WatchList {
 public:
  [[nodiscard]] std::unique_ptr<MapService::Watcher> add(std::function<void()> changed) {
    auto watcher = std::make_unique<MapService::Watcher>(std::move(changed), [] {});
    const MapService::Watcher* key = watcher.get();
    watcher->gone_ = [list = list_, key] { list->remove(key); };
    const std::lock_guard lock(list_->mutex);
    list_->all.push_back(watcher.get());
    return watcher;
  }
  void tell() {
    const std::lock_guard lock(list_->mutex);
    for (const MapService::Watcher* w : list_->all) w->changed_();
  }
  [[nodiscard]] std::size_t size() const {
    const std::lock_guard lock(list_->mutex);
    return list_->all.size();
  }

 private:
  struct List {
    std::mutex mutex;
    std::list<const MapService::Watcher*> all;
    void remove(const MapService::Watcher* w) {
      const std::lock_guard lock(mutex);
      all.remove(w);
    }
  };
  std::shared_ptr<List> list_ = std::make_shared<List>();  // a watcher may outlive the map
};

}  // namespace mapcodec
