// SPDX-License-Identifier: GPL-3.0-or-later
// What the process tells the service manager [sd_notify(3)]. Without one everything here does nothing.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace mapcodec::daemon {

/// @param status  one line for `systemctl status`.
void notify_ready(const std::string& status);
void notify_stopping();

/// Says that the process is well, twice in each interval that the manager asks for, as long as `is_well`
/// returns true; if it returns false or does not return, the manager restarts the process.
class Watchdog {
 public:
  explicit Watchdog(std::function<bool()> is_well);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

 private:
  void run(std::chrono::microseconds interval);
  std::function<bool()> is_well_;
  std::mutex mutex_;
  std::condition_variable ended_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace mapcodec::daemon
