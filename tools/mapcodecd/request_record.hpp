// SPDX-License-Identifier: GPL-3.0-or-later
// A request as the log shows it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace mapcodec::daemon {

struct RequestRecord {
  std::string id;         ///< request_id
  std::string transport;  ///< "grpc", "http"
  std::string method;     ///< "Insert", "GET /maps/yard/index"
  std::string code;       ///< "OK", "NOT_FOUND", "200"
  std::string principal;  ///< empty: nobody was let in
  std::string peer;
  std::string error;  ///< what the client was told; empty: nothing
  std::uint64_t bytes_in = 0, bytes_out = 0;
  double seconds = 0;
};

/// Called once after each request, from any thread; must not wait.
using RecordRequest = std::function<void(const RequestRecord&)>;

/// What the client called its request, if that is 1 to 64 letters, digits, '-', '_', '.' or ':' (a log line
/// stays one line); else a new one of 16 hexadecimal digits. Threads: any.
[[nodiscard]] std::string request_id(std::string_view from_client);

}  // namespace mapcodec::daemon
