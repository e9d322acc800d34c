// SPDX-License-Identifier: GPL-3.0-or-later
// Who may do what: asked once at the beginning of each call, whatever carries it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// Each right includes those before it.
enum class Right : std::uint8_t { read, write, admin };
[[nodiscard]] constexpr const char* right_name(Right r) {
  constexpr const char* kNames[] = {"read", "write", "admin"};
  return kNames[static_cast<std::size_t>(r) <= 2 ? static_cast<std::size_t>(r) : 0];
}

/// What a call brings along.
struct Credentials {
  std::string token;         ///< of "authorization: Bearer TOKEN"; empty: none
  std::string peer;          ///< "ipv4:127.0.0.1:4711", "unix:", as the transport says
  std::string peer_subject;  ///< common name of a verified client certificate; empty: none
  bool local = false;        ///< over a unix socket or loopback
};

/// A call that was let in; counts for its client until it goes away. Threads: any, one at a time.
class Admission {
 public:
  virtual ~Admission() = default;
  /// For logs. "anonymous" where tokens are not asked for.
  [[nodiscard]] virtual const std::string& principal() const = 0;
  /// Counts bytes that came in or will go out. Errors: Busy (the client's rate is used up; nothing was
  /// counted).
  [[nodiscard]] virtual Status charge(std::uint64_t bytes) = 0;
};

enum class CallKind : std::uint8_t { unary, stream };

/// Threads: from many at once.
class AccessControl {
 public:
  virtual ~AccessControl() = default;
  /// @param map  empty: the service as a whole (list: maps that may be read; create: any).
  /// Errors: Unauthenticated, Denied, Busy (rate of calls, open streams).
  [[nodiscard]] virtual Result<std::unique_ptr<Admission>> admit(const Credentials& who, Right right,
                                                                 const std::string& map, CallKind kind) = 0;
  /// Whether `who` may see that the map is there. Never counts.
  [[nodiscard]] virtual bool may_read(const Credentials& who, const std::string& map) = 0;
};

/// Lets everybody do everything: for tests, and for a daemon on a private socket without tokens.
[[nodiscard]] std::unique_ptr<AccessControl> open_access();

}  // namespace mapcodec
