// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/supervisor.hpp"

#include <systemd/sd-daemon.h>

#include <algorithm>
#include <chrono>

namespace mapcodec::daemon {

void notify_ready(const std::string& status) {
  std::string line = status;
  std::replace(line.begin(), line.end(), '\n', ' ');
  sd_notify(0, ("READY=1\nSTATUS=" + line).c_str());
}

void notify_stopping() {
  sd_notify(0, "STOPPING=1\nSTATUS=committing what is queued");
}

Watchdog::Watchdog(std::function<bool()> is_well) : is_well_(std::move(is_well)) {
  std::uint64_t interval_us = 0;
  if (sd_watchdog_enabled(0, &interval_us) <= 0) return;
  thread_ = std::thread([this, interval_us] { run(std::chrono::microseconds(interval_us / 2)); });
}

void Watchdog::run(std::chrono::microseconds interval) {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    lock.unlock();
    if (is_well_()) sd_notify(0, "WATCHDOG=1");
    lock.lock();
    ended_.wait_for(lock, interval, [this] { return stop_; });
  }
}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  ended_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace mapcodec::daemon
