// SPDX-License-Identifier: GPL-3.0-or-later
// Takes connections for gRPC, which by itself takes as many as come, and stops listening for good once the
// process has no more files.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <thread>
#include <vector>

#include "tools/mapcodecd/http/listening_socket.hpp"

namespace mapcodec::daemon {

/// Threads: start and stop from one.
class ConnectionAcceptor {
 public:
  /// Owns the socket that it is given.
  using Take = std::function<void(int socket)>;

  explicit ConnectionAcceptor(std::size_t max_connections) : max_connections_(max_connections) {}
  ~ConnectionAcceptor() { stop(); }
  ConnectionAcceptor(const ConnectionAcceptor&) = delete;
  ConnectionAcceptor& operator=(const ConnectionAcceptor&) = delete;

  void add(ListeningSocket socket, Take take) { sources_.push_back({std::move(socket), std::move(take)}); }
  void start();
  /// Closes the sockets it listens on, and removes those of the file system.
  void stop();

 private:
  struct Source {
    ListeningSocket socket;
    Take take;
  };
  void run();
  void accept_from(const Source& source);
  [[nodiscard]] bool has_room();

  const std::size_t max_connections_;
  std::vector<Source> sources_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
  std::map<int, ino_t> given_;  ///< sockets that were given away, by number; some may have ended since
  std::chrono::steady_clock::time_point looked_;
};

}  // namespace mapcodec::daemon
