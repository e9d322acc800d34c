// SPDX-License-Identifier: GPL-3.0-or-later
// Where the daemon may listen, and with what credentials.
#pragma once

#include <string>

#include "mapcodec/base/result.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

struct Address {
  std::string host, port;   ///< without brackets
  std::string socket_path;  ///< of a unix socket; then host and port are empty
  [[nodiscard]] bool is_socket() const { return !socket_path.empty(); }
  /// Of this machine alone.
  [[nodiscard]] bool is_loopback() const;
};

/// "127.0.0.1:7311", "[::1]:7311", "localhost:0", "unix:/path". Errors: InvalidArgument.
[[nodiscard]] Result<Address> parse_address(const std::string& text);
/// Plain text stays on this machine, unless somebody asked for it. Errors: InvalidArgument.
[[nodiscard]] Status check_plain(const Address& address, const TlsSettings& tls, bool insecure);

}  // namespace mapcodec::daemon
