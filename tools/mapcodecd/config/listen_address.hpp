// SPDX-License-Identifier: GPL-3.0-or-later
// Where a server may listen, and how openly.
#pragma once

#include <cstdint>
#include <string>

#include "mapcodec/base/result.hpp"

namespace mapcodec::daemon {

struct ListenAddress {
  enum class Kind : std::uint8_t { ipv4, ipv6, unix_socket };
  Kind kind = Kind::ipv4;
  std::string host;        ///< number, without brackets
  std::uint16_t port = 0;  ///< 0: a free one
  std::string path;        ///< of a unix socket
  [[nodiscard]] bool loopback() const;
  /// Reached from this machine only.
  [[nodiscard]] bool local() const { return kind == Kind::unix_socket || loopback(); }
  /// As it was written: "127.0.0.1:80", "[::1]:80", "unix:/run/x.sock".
  [[nodiscard]] std::string to_string() const;
};

/// "127.0.0.1:7311", "localhost:7311" (127.0.0.1), "[::1]:0", "unix:/run/mapcodecd.sock" (an absolute path of
/// at most 107 bytes). Names are not looked up: what a name means can change under a running rule.
/// Errors: InvalidArgument.
[[nodiscard]] Result<ListenAddress> parse_listen_address(const std::string& text);

/// Plain text stays on this machine unless it was asked for.
/// Errors: InvalidArgument (plain text beyond loopback without `insecure`).
[[nodiscard]] Status check_listen(const ListenAddress& address, bool tls, bool insecure);

}  // namespace mapcodec::daemon
