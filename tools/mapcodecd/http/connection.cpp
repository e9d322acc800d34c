// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/connection.hpp"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <climits>

#include "tools/mapcodecd/tls/tls_context.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::size_t kReadBytes = 4096;
constexpr std::string_view kEndOfHeader = "\r\n\r\n";

bool would_block() {
  return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
}

/// What TLS waits for after a call that did not succeed; 0: nothing, it has ended.
short tls_waits_for(ssl_st* tls, int outcome) {
  const int reason = SSL_get_error(tls, outcome);
  ERR_clear_error();
  return reason == SSL_ERROR_WANT_READ ? POLLIN : reason == SSL_ERROR_WANT_WRITE ? POLLOUT : short{0};
}

Connection::Progress waiting(short events) {
  if (events == 0) return Connection::Progress::closed;
  return events == POLLOUT ? Connection::Progress::wants_write : Connection::Progress::wants_read;
}

}  // namespace

Connection::Connection(FileHandle socket, Peer peer, ssl_st* tls, std::size_t max_header_bytes)
    : socket_(std::move(socket)),
      peer_(std::move(peer)),
      tls_(tls),
      max_header_bytes_(max_header_bytes),
      in_handshake_(tls != nullptr) {}

Connection::~Connection() {
  if (tls_ == nullptr) return;
  if (!in_handshake_) SSL_shutdown(tls_);  // says goodbye if the socket takes it at once
  ERR_clear_error();
  SSL_free(tls_);
}

void Connection::cut() {
  ::shutdown(socket_.fd(), SHUT_RDWR);
}

Connection::Progress Connection::advance() {
  if (in_handshake_) {
    const Progress progress = shake_hands();
    if (progress != Progress::ready) return progress;
  }
  while (!header_is_whole()) {
    if (buffer_.size() - taken_ > max_header_bytes_) return Progress::too_long;
    const Progress progress = read_some();
    if (progress != Progress::ready) return progress;
  }
  return Progress::ready;
}

Connection::Progress Connection::shake_hands() {
  const int outcome = SSL_do_handshake(tls_);
  if (outcome != 1) return waiting(tls_waits_for(tls_, outcome));
  in_handshake_ = false;
  peer_.subject = peer_common_name(tls_);
  return Progress::ready;
}

bool Connection::header_is_whole() {
  if (taken_ > 0) {  // what the last request used up
    buffer_.erase(0, taken_);
    taken_ = searched_ = 0;
  }
  const std::size_t from = searched_ < kEndOfHeader.size() ? 0 : searched_ - kEndOfHeader.size();
  searched_ = buffer_.size();
  return buffer_.find(kEndOfHeader, from) != buffer_.npos;
}

Connection::Progress Connection::read_some() {
  char bytes[kReadBytes];
  if (tls_ != nullptr) {
    const int count = SSL_read(tls_, bytes, sizeof bytes);
    if (count <= 0) return waiting(tls_waits_for(tls_, count));
    buffer_.append(bytes, static_cast<std::size_t>(count));
    return Progress::ready;
  }
  const ssize_t count = recv(socket_.fd(), bytes, sizeof bytes, 0);
  if (count < 0) return would_block() ? Progress::wants_read : Progress::closed;
  if (count == 0) return Progress::closed;
  buffer_.append(bytes, static_cast<std::size_t>(count));
  return Progress::ready;
}

std::size_t Connection::take(char* out, std::size_t size) {
  const std::size_t count = std::min(size, buffer_.size() - taken_);
  buffer_.copy(out, count, taken_);
  taken_ += count;
  return count;
}

long Connection::write_some(std::string_view bytes, short& wait_for) {
  if (tls_ == nullptr) {
    const ssize_t count = ::send(socket_.fd(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count < 0) wait_for = would_block() ? POLLOUT : short{0};
    return count;
  }
  const int count =
      SSL_write(tls_, bytes.data(), static_cast<int>(std::min<std::size_t>(bytes.size(), INT_MAX)));
  if (count <= 0) wait_for = tls_waits_for(tls_, count);
  return count;
}

bool Connection::send(std::string_view bytes) {
  while (!bytes.empty()) {
    short wait_for = 0;
    const long count = write_some(bytes, wait_for);
    if (count > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(count));
      bytes_sent_ += static_cast<std::uint64_t>(count);
    } else if (wait_for == 0 || !wait(wait_for)) {
      return false;
    }
  }
  return true;
}

bool Connection::wait(short events) const {
  const auto left = write_deadline_ - std::chrono::steady_clock::now();
  const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
  if (left_ms <= 0) return false;
  pollfd waiter{socket_.fd(), events, 0};
  const int outcome = poll(&waiter, 1, static_cast<int>(std::min<long long>(left_ms, INT_MAX)));
  return outcome > 0 || (outcome < 0 && errno == EINTR);
}

}  // namespace mapcodec::daemon
