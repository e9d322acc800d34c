// SPDX-License-Identifier: GPL-3.0-or-later
// The open connections of the HTTP server: those that rest in epoll, and those that a worker has.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "tools/mapcodecd/http/connection.hpp"

namespace mapcodec::daemon {

/// A connection rests (until its deadline) or waits for a worker or is with one. Threads: any.
class ConnectionTable {
 public:
  /// Adds one that rests.
  void add(std::unique_ptr<Connection> connection);
  /// The one with this socket no longer rests: it waits for a worker. Where `most` wait already it is given
  /// back instead.
  [[nodiscard]] std::unique_ptr<Connection> queue(int fd, std::size_t most);
  /// The next that waits; nullptr once closed. Waits.
  [[nodiscard]] Connection* next();
  /// A worker gives it back: it rests until its deadline, and must not be touched any more.
  /// @param wait  has its socket waited for; called while it cannot end, so that the socket's number is still
  /// its own.
  void rest(Connection& connection, const std::function<void(int fd)>& wait);
  /// A worker ends it.
  void end(Connection& connection);
  /// Ends those that rested beyond their deadline. @return how many.
  std::size_t end_late(SteadyTime now);
  /// Ends the one that has rested longest. False: none rests.
  bool end_longest_resting();
  /// Ends all that rest, lets no more wait, and wakes the workers.
  void close();
  /// Makes the transfers of all that workers have fail.
  void cut();

  struct Counts {
    std::size_t open = 0, waiting = 0, working = 0;
  };
  [[nodiscard]] Counts counts() const;

 private:
  struct Entry {
    std::unique_ptr<Connection> connection;
    bool resting = true;
    SteadyTime since;
  };
  mutable std::mutex mutex_;
  std::condition_variable has_work_;
  std::unordered_map<int, Entry> entries_;
  std::deque<Connection*> waiting_;
  std::size_t working_ = 0;
  bool closed_ = false;
};

}  // namespace mapcodec::daemon
