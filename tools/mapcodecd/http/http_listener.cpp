// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/http_listener.hpp"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <optional>
#include <thread>

#include "tools/mapcodecd/http/connection_table.hpp"
#include "tools/mapcodecd/http/listening_socket.hpp"
#include "tools/mapcodecd/tls/tls_context.hpp"

namespace mapcodec::daemon {
namespace {

using Clock = std::chrono::steady_clock;
using Progress = Connection::Progress;
constexpr int kSweepMs = 200;          // how late a deadline may be noticed
constexpr int kAcceptsPerRound = 256;  // then those that are open get their turn

constexpr std::string_view kBusy =
    "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
constexpr std::string_view kTooLong =
    "HTTP/1.1 431 Request Header Fields Too Large\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";

SteadyTime after(double seconds) {
  return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

/// As gRPC writes it.
std::string peer_name(const sockaddr_storage& address) {
  char host[INET6_ADDRSTRLEN] = "";
  if (address.ss_family == AF_INET) {
    sockaddr_in name{};
    std::memcpy(&name, &address, sizeof name);
    inet_ntop(AF_INET, &name.sin_addr, host, sizeof host);
    return std::string("ipv4:") + host + ":" + std::to_string(ntohs(name.sin_port));
  }
  if (address.ss_family == AF_INET6) {
    sockaddr_in6 name{};
    std::memcpy(&name, &address, sizeof name);
    inet_ntop(AF_INET6, &name.sin6_addr, host, sizeof host);
    return std::string("ipv6:[") + host + "]:" + std::to_string(ntohs(name.sin6_port));
  }
  return "unix:";
}

}  // namespace

struct HttpListener::Impl {
  Impl(const HttpSettings& s, Serve f) : settings(s), serve(std::move(f)) {}

  const HttpSettings settings;
  const Serve serve;
  std::optional<TlsContext> tls;
  std::vector<ListeningSocket> sockets;
  std::vector<std::string> addresses;
  FileHandle epoll, wake;
  ConnectionTable table;
  std::thread poller;
  std::vector<std::thread> workers;
  std::atomic<bool> stopping{false};
  std::atomic<std::uint64_t> accepted{0}, evicted{0}, timed_out{0}, refused{0};

  [[nodiscard]] Status open();
  [[nodiscard]] Status watch(int fd, std::uint32_t events, int operation) const;
  void poll_until_stopped();
  void on_event(int fd);
  void accept_from(const ListeningSocket& from);
  void welcome(FileHandle socket, const ListeningSocket& from, const sockaddr_storage& address);
  [[nodiscard]] bool make_room();
  void refuse(std::unique_ptr<Connection> connection);
  void work();
  void attend(Connection& connection);
  void park(Connection& connection, std::uint32_t events);
};

Status HttpListener::Impl::watch(int fd, std::uint32_t events, int operation) const {
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  if (epoll_ctl(epoll.fd(), operation, fd, &event) == 0) return {};
  return make_error(ErrorCode::kLimitExceeded,
                    std::string("cannot wait for a socket: ") + std::strerror(errno));
}

Status HttpListener::Impl::open() {
  if (settings.tls.enabled()) {
    MAPCODEC_ASSIGN(TlsContext context, TlsContext::open(settings.tls));
    tls.emplace(std::move(context));
  }
  epoll = FileHandle(epoll_create1(EPOLL_CLOEXEC));
  wake = FileHandle(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  MAPCODEC_TRY(watch(wake.fd(), EPOLLIN, EPOLL_CTL_ADD));
  for (const std::string& text : settings.listen) {
    MAPCODEC_ASSIGN(const ListenAddress address, parse_listen_address(text));
    MAPCODEC_TRY(check_listen(address, tls.has_value(), settings.insecure));
    MAPCODEC_ASSIGN(ListeningSocket socket, listen_on(address));
    MAPCODEC_TRY(watch(socket.handle.fd(), EPOLLIN, EPOLL_CTL_ADD));
    addresses.push_back(socket.address.to_string());
    sockets.push_back(std::move(socket));
  }
  return {};
}

void HttpListener::Impl::poll_until_stopped() {
  std::vector<epoll_event> events(256);
  SteadyTime swept = Clock::now();
  while (!stopping) {
    const int count = epoll_wait(epoll.fd(), events.data(), static_cast<int>(events.size()), kSweepMs);
    for (int i = 0; i < count; ++i) on_event(events[static_cast<std::size_t>(i)].data.fd);
    const SteadyTime now = Clock::now();
    if (now - swept < std::chrono::milliseconds(kSweepMs)) continue;
    timed_out += table.end_late(now);
    swept = now;
  }
}

void HttpListener::Impl::on_event(int fd) {
  if (fd == wake.fd()) return;
  for (const ListeningSocket& socket : sockets) {
    if (socket.handle.fd() == fd) return accept_from(socket);
  }
  if (auto turned_away = table.queue(fd, settings.max_waiting)) refuse(std::move(turned_away));
}

void HttpListener::Impl::accept_from(const ListeningSocket& from) {
  for (int i = 0; i < kAcceptsPerRound; ++i) {
    sockaddr_storage address{};
    socklen_t length = sizeof address;
    FileHandle socket(accept4(from.handle.fd(), reinterpret_cast<sockaddr*>(&address), &length,
                              SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (socket.is_open()) {
      ++accepted;
      welcome(std::move(socket), from, address);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      // Without room the socket stays readable: a short rest keeps this from spinning.
      if (!make_room()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
      return;
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return;
    }
  }
}

void HttpListener::Impl::welcome(FileHandle socket, const ListeningSocket& from,
                                 const sockaddr_storage& address) {
  const int fd = socket.fd();
  const bool is_socket = from.address.kind == ListenAddress::Kind::unix_socket;
  const bool secure = tls.has_value() && !is_socket;
  const int on = 1;
  if (!is_socket) setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ssl_st* session = secure ? tls->accept(fd) : nullptr;
  if (secure && session == nullptr) return;
  Peer peer{is_socket ? "unix:" : peer_name(address), from.address.local() && !secure, {}};
  auto connection =
      std::make_unique<Connection>(std::move(socket), std::move(peer), session, settings.max_header_bytes);
  connection->rest_until(after(secure ? settings.read_timeout_s : settings.idle_timeout_s));
  if (table.counts().open >= settings.max_connections && !make_room()) return refuse(std::move(connection));
  table.add(std::move(connection));
  if (!watch(fd, EPOLLIN | EPOLLRDHUP | EPOLLONESHOT, EPOLL_CTL_ADD).ok()) {
    auto lost = table.queue(fd, 0);  // taken back, and closed
  }
}

bool HttpListener::Impl::make_room() {
  const bool made = table.end_longest_resting();
  if (made) ++evicted;
  return made;
}

void HttpListener::Impl::refuse(std::unique_ptr<Connection> connection) {
  ++refused;
  connection->set_write_deadline(Clock::now());  // what the socket takes at once
  if (!connection->send(kBusy)) connection->cut();
}

void HttpListener::Impl::work() {
  while (Connection* connection = table.next()) attend(*connection);
}

void HttpListener::Impl::attend(Connection& connection) {
  while (!stopping) {
    switch (connection.advance()) {
      case Progress::wants_read:
        return park(connection, EPOLLIN | EPOLLRDHUP);
      case Progress::wants_write:
        return park(connection, EPOLLOUT);
      case Progress::closed:
        return table.end(connection);
      case Progress::too_long:
        connection.set_write_deadline(Clock::now());
        if (!connection.send(kTooLong)) connection.cut();
        return table.end(connection);
      case Progress::ready:
        connection.set_write_deadline(after(settings.write_timeout_s));
        if (!serve(connection)) return table.end(connection);
        connection.rest_until(after(settings.idle_timeout_s));
    }
  }
  table.end(connection);
}

void HttpListener::Impl::park(Connection& connection, std::uint32_t events) {
  if (connection.in_request()) connection.request_until(after(settings.read_timeout_s));
  if (connection.deadline() <= Clock::now()) {  // a sweep may miss one that is busy with a byte each time
    ++timed_out;
    return table.end(connection);
  }
  table.rest(connection, [&](int fd) { (void)watch(fd, events | EPOLLONESHOT, EPOLL_CTL_MOD).ok(); });
}

HttpListener::HttpListener(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<HttpListener>> HttpListener::start(const HttpSettings& settings, Serve serve) {
  std::signal(SIGPIPE, SIG_IGN);  // a write of OpenSSL to a client that is gone is an error, not an end
  auto impl = std::make_unique<Impl>(settings, std::move(serve));
  MAPCODEC_TRY(impl->open());
  std::unique_ptr<HttpListener> listener(new HttpListener(std::move(impl)));
  Impl& started = *listener->impl_;
  started.poller = std::thread([&started] { started.poll_until_stopped(); });
  for (unsigned i = 0; i < settings.workers; ++i)
    started.workers.emplace_back([&started] { started.work(); });
  return listener;
}

const std::vector<std::string>& HttpListener::addresses() const {
  return impl_->addresses;
}

HttpListener::Figures HttpListener::figures() const {
  const ConnectionTable::Counts counts = impl_->table.counts();
  return {counts.open,    counts.waiting,   counts.working, impl_->accepted,
          impl_->evicted, impl_->timed_out, impl_->refused};
}

void HttpListener::stop(SteadyTime deadline) {
  if (impl_->stopping.exchange(true)) return;
  const std::uint64_t one = 1;
  if (write(impl_->wake.fd(), &one, sizeof one) != sizeof one)
    errno = 0;  // the poller looks up in time anyway
  impl_->poller.join();
  impl_->table.close();
  while (impl_->table.counts().working > 0 && Clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  impl_->table.cut();
  for (std::thread& worker : impl_->workers) worker.join();
  for (const ListeningSocket& socket : impl_->sockets) {
    if (socket.address.kind == ListenAddress::Kind::unix_socket) unlink(socket.address.path.c_str());
  }
  impl_->sockets.clear();
}

HttpListener::~HttpListener() {
  stop(Clock::now());
}

}  // namespace mapcodec::daemon
