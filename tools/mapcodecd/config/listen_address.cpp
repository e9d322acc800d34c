// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/config/listen_address.hpp"

#include <arpa/inet.h>
#include <sys/un.h>

#include <charconv>
#include <cstring>

namespace mapcodec::daemon {
namespace {

Error refused(const std::string& text, const char* what) {
  return make_error(ErrorCode::kInvalidArgument, "'" + text + "': " + what);
}

Result<ListenAddress> parse_socket(const std::string& text) {
  ListenAddress address{ListenAddress::Kind::unix_socket, {}, 0, text.substr(std::strlen("unix:"))};
  if (address.path.empty() || address.path[0] != '/') return refused(text, "a socket needs an absolute path");
  if (address.path.size() >= sizeof(sockaddr_un::sun_path))
    return refused(text, "the path of a socket is too long");
  return address;
}

bool parse_port(std::string_view digits, std::uint16_t& port) {
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  return error == std::errc{} && end == digits.data() + digits.size();
}

bool is_number(int family, const std::string& host) {
  unsigned char bytes[sizeof(in6_addr)];
  return inet_pton(family, host.c_str(), bytes) == 1;
}

}  // namespace

bool ListenAddress::loopback() const {
  if (kind == Kind::ipv4) return host.rfind("127.", 0) == 0;
  in6_addr bytes{};
  return kind == Kind::ipv6 && inet_pton(AF_INET6, host.c_str(), &bytes) == 1 &&
         std::memcmp(&bytes, &in6addr_loopback, sizeof bytes) == 0;
}

std::string ListenAddress::to_string() const {
  if (kind == Kind::unix_socket) return "unix:" + path;
  return (kind == Kind::ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

Result<ListenAddress> parse_listen_address(const std::string& text) {
  if (text.rfind("unix:", 0) == 0) return parse_socket(text);
  const std::size_t colon = text.rfind(':');
  if (colon == text.npos) return refused(text, "an address is HOST:PORT or unix:/PATH");
  ListenAddress address;
  if (!parse_port(std::string_view(text).substr(colon + 1), address.port)) return refused(text, "not a port");
  address.host = text.substr(0, colon);
  if (address.host == "localhost") address.host = "127.0.0.1";
  if (address.host.size() > 2 && address.host.front() == '[' && address.host.back() == ']') {
    address.kind = ListenAddress::Kind::ipv6;
    address.host = address.host.substr(1, address.host.size() - 2);
  }
  const int family = address.kind == ListenAddress::Kind::ipv6 ? AF_INET6 : AF_INET;
  if (!is_number(family, address.host))
    return refused(text, "the host must be a number: 127.0.0.1, [::1], 0.0.0.0");
  return address;
}

Status check_listen(const ListenAddress& address, bool tls, bool insecure) {
  if (address.local() || tls || insecure) return {};
  return refused(
      address.to_string(),
      "would be plain text beyond loopback: give [tls] a certificate, or ask for it with --insecure");
}

}  // namespace mapcodec::daemon
