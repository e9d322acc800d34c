// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/listening_socket.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>

namespace mapcodec::daemon {
namespace {

constexpr int kBacklog = 1024;

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t length = 0;
  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
  [[nodiscard]] sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
};

SocketAddress socket_address(const ListenAddress& address) {
  SocketAddress out;
  if (address.kind == ListenAddress::Kind::unix_socket) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path, address.path.c_str(), address.path.size() + 1);
    std::memcpy(&out.storage, &name, out.length = sizeof name);
  } else if (address.kind == ListenAddress::Kind::ipv6) {
    sockaddr_in6 name{};
    name.sin6_family = AF_INET6;
    name.sin6_port = htons(address.port);
    inet_pton(AF_INET6, address.host.c_str(), &name.sin6_addr);
    std::memcpy(&out.storage, &name, out.length = sizeof name);
  } else {
    sockaddr_in name{};
    name.sin_family = AF_INET;
    name.sin_port = htons(address.port);
    inet_pton(AF_INET, address.host.c_str(), &name.sin_addr);
    std::memcpy(&out.storage, &name, out.length = sizeof name);
  }
  return out;
}

Error failed(const ListenAddress& address, const char* what) {
  return make_error(ErrorCode::kCannotWrite, address.to_string() + ": " + what + ": " + std::strerror(errno));
}

/// True if a daemon that is gone left the socket at `path`.
bool is_stale(const SocketAddress& name, const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0 || !S_ISSOCK(status.st_mode)) return false;
  const FileHandle probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return probe.is_open() && connect(probe.fd(), name.get(), name.length) != 0 && errno == ECONNREFUSED;
}

/// The mode is set before anybody can connect: while bind makes the file, not afterwards.
int bind_privately(int fd, const SocketAddress& name) {
  const mode_t before = umask(0177);
  const int outcome = bind(fd, name.get(), name.length);
  umask(before);
  return outcome;
}

Status bind_to(int fd, const ListenAddress& address) {
  const SocketAddress name = socket_address(address);
  if (address.kind == ListenAddress::Kind::unix_socket) {
    if (is_stale(name, address.path)) unlink(address.path.c_str());
    if (bind_privately(fd, name) != 0) return failed(address, "cannot be bound");
    return {};
  }
  const int on = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (address.kind == ListenAddress::Kind::ipv6) setsockopt(fd, IPPROTO_IPV6, IPV6_V6ONLY, &on, sizeof on);
  if (bind(fd, name.get(), name.length) != 0) return failed(address, "cannot be bound");
  return {};
}

std::uint16_t bound_port(int fd) {
  SocketAddress name;
  name.length = sizeof name.storage;
  if (getsockname(fd, name.get(), &name.length) != 0) return 0;
  std::uint16_t port = 0;  // at the same place for both families
  std::memcpy(&port, reinterpret_cast<const char*>(&name.storage) + offsetof(sockaddr_in, sin_port),
              sizeof port);
  return ntohs(port);
}

}  // namespace

Result<ListeningSocket> listen_on(const ListenAddress& address) {
  const int family = address.kind == ListenAddress::Kind::unix_socket ? AF_UNIX
                     : address.kind == ListenAddress::Kind::ipv6      ? AF_INET6
                                                                      : AF_INET;
  ListeningSocket out{FileHandle(socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)), address};
  if (!out.handle.is_open()) return failed(address, "no socket");
  MAPCODEC_TRY(bind_to(out.handle.fd(), address));
  if (listen(out.handle.fd(), kBacklog) != 0) return failed(address, "cannot listen");
  if (family != AF_UNIX) out.address.port = bound_port(out.handle.fd());
  return out;
}

}  // namespace mapcodec::daemon
