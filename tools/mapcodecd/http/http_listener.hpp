// SPDX-License-Identifier: GPL-3.0-or-later
// Takes connections, waits for whole requests without a thread for each, and gives them to workers: a client
// that sends slowly costs a socket and nothing else.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tools/mapcodecd/http/connection.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// Threads: methods from any.
class HttpListener {
 public:
  /// Answers the request whose header is there; called by workers. False: the connection ends.
  using Serve = std::function<bool(Connection&)>;

  struct Figures {
    std::size_t connections = 0;  ///< open
    std::size_t waiting = 0;      ///< requests without a worker
    std::size_t busy_workers = 0;
    std::uint64_t accepted = 0;   ///< so far
    std::uint64_t evicted = 0;    ///< made room for others
    std::uint64_t timed_out = 0;  ///< were too slow
    std::uint64_t refused = 0;    ///< told 503
  };

  /// Errors: InvalidArgument (addresses, certificates), NotFound, Malformed (certificates), CannotWrite
  /// (address in use).
  [[nodiscard]] static Result<std::unique_ptr<HttpListener>> start(const HttpSettings& settings, Serve serve);
  /// As stop with no time left.
  ~HttpListener();
  HttpListener(const HttpListener&) = delete;
  HttpListener& operator=(const HttpListener&) = delete;

  /// What was bound, ports filled in.
  [[nodiscard]] const std::vector<std::string>& addresses() const;
  [[nodiscard]] Figures figures() const;
  /// Takes no more connections and requests; those that are answered may end until `deadline`. Waits.
  void stop(SteadyTime deadline);

 private:
  struct Impl;
  explicit HttpListener(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec::daemon
