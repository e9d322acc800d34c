// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/acceptor.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace mapcodec::daemon {
namespace {

constexpr int kLookUpMs = 100;                              // how late a stop may be noticed
constexpr int kAcceptsPerRound = 256;                       // then the other sockets get their turn
constexpr auto kLookAgain = std::chrono::milliseconds(20);  // while all places are taken

/// Of an open file; 0: it is closed.
ino_t identity(int fd) {
  struct stat status {};
  return fstat(fd, &status) == 0 ? status.st_ino : 0;
}

}  // namespace

void ConnectionAcceptor::start() {
  thread_ = std::thread([this] { run(); });
}

void ConnectionAcceptor::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  for (const Source& source : sources_) {
    const ListenAddress& address = source.socket.address;
    if (address.kind == ListenAddress::Kind::unix_socket) unlink(address.path.c_str());
  }
  sources_.clear();
}

void ConnectionAcceptor::run() {
  std::vector<pollfd> waiters;
  for (const Source& source : sources_) waiters.push_back({source.socket.handle.fd(), POLLIN, 0});
  while (!stopping_) {
    if (poll(waiters.data(), waiters.size(), kLookUpMs) <= 0) continue;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      if (waiters[i].revents != 0) accept_from(sources_[i]);
    }
  }
}

/// gRPC does not say when it closes a connection, so the numbers that were given to it are looked at: a
/// closed one, or one that is another file now, is a free place.
bool ConnectionAcceptor::has_room() {
  if (given_.size() < max_connections_) return true;
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_ < kLookAgain) return false;
  looked_ = now;
  std::erase_if(given_, [](const auto& given) { return identity(given.first) != given.second; });
  return given_.size() < max_connections_;
}

void ConnectionAcceptor::accept_from(const Source& source) {
  for (int i = 0; i < kAcceptsPerRound && !stopping_; ++i) {
    const int fd = accept4(source.socket.handle.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0) {
      const bool no_files = errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM;
      // The socket stays readable: a short rest keeps this from spinning.
      if (no_files) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (no_files || errno == EAGAIN || errno == EWOULDBLOCK) return;
      continue;
    }
    if (!has_room()) {
      ::close(fd);
      continue;
    }
    const int on = 1;
    if (source.socket.address.kind != ListenAddress::Kind::unix_socket) {
      setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    }
    given_.insert_or_assign(fd, identity(fd));
    source.take(fd);
  }
}

}  // namespace mapcodec::daemon
