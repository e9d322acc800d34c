// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/listen.hpp"

#include <algorithm>

namespace mapcodec::daemon {

bool Address::is_loopback() const {
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

Result<Address> parse_address(const std::string& text) {
  const auto bad = [&] {
    return make_error(ErrorCode::kInvalidArgument,
                      "'" + text + "' is no address: HOST:PORT, [HOST]:PORT or unix:/PATH");
  };
  Address a;
  if (text.rfind("unix:", 0) == 0) {
    a.socket_path = text.substr(5);
    if (a.socket_path.empty() || a.socket_path[0] != '/' || a.socket_path.size() > 100) return bad();
    return a;
  }
  const auto colon = text.rfind(':');
  if (colon == std::string::npos) return bad();
  a.host = text.substr(0, colon);
  a.port = text.substr(colon + 1);
  if (a.host.size() > 2 && a.host.front() == '[' && a.host.back() == ']') a.host = a.host.substr(1, a.host.size() - 2);
  const bool digits = !a.port.empty() && a.port.size() <= 5 &&
                      std::all_of(a.port.begin(), a.port.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (a.host.empty() || !digits || std::stoi(a.port) > 65535) return bad();
  return a;
}

Status check_plain(const Address& address, const TlsSettings& tls, bool insecure) {
  if (address.is_socket() || address.is_loopback() || tls.enabled() || insecure) return {};
  return make_error(ErrorCode::kInvalidArgument,
                    address.host + ": without TLS the daemon listens on loopback only (--insecure overrides)");
}

}  // namespace mapcodec::daemon
