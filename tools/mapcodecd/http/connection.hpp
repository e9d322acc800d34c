// SPDX-License-Identifier: GPL-3.0-or-later
// One client of the HTTP server: bytes in without blocking, bytes out under a deadline, with or without TLS.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

#include "maps/file_store.hpp"

struct ssl_st;

namespace mapcodec::daemon {

using SteadyTime = std::chrono::steady_clock::time_point;

/// Who is at the other end.
struct Peer {
  std::string name;     ///< "ipv4:127.0.0.1:4711", "unix:"
  bool local = false;   ///< on this machine, without TLS in between
  std::string subject;  ///< common name of the client's certificate
};

/// Threads: one at a time.
class Connection {
 public:
  enum class Progress : std::uint8_t {
    wants_read,   ///< nothing to do until more bytes come
    wants_write,  ///< nothing to do until bytes can go out (TLS handshake)
    ready,        ///< a whole request header is there
    too_long,     ///< a header longer than is taken
    closed,       ///< by the client, by an error
  };

  /// @param tls  nullptr: plain text; else a server's end over `socket`, owned from now on.
  Connection(FileHandle socket, Peer peer, ssl_st* tls, std::size_t max_header_bytes);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Does what can be done without waiting: the TLS handshake, reading up to the end of a header.
  [[nodiscard]] Progress advance();
  /// True if a request has begun to come in, and is not whole.
  [[nodiscard]] bool in_request() const { return !in_handshake_ && taken_ < buffer_.size(); }

  /// When it ends if nothing happens. A request that has begun keeps its first deadline, however often a byte
  /// of it comes.
  [[nodiscard]] SteadyTime deadline() const { return deadline_; }
  void rest_until(SteadyTime deadline) {
    deadline_ = deadline;
    request_begun_ = false;
  }
  void request_until(SteadyTime deadline) {
    if (!request_begun_) deadline_ = deadline;
    request_begun_ = true;
  }

  /// Takes bytes that were read. @return how many; 0: there are no more.
  [[nodiscard]] std::size_t take(char* out, std::size_t size);
  /// Sends all of it, waiting until `write_deadline` at most. False: the connection is of no more use.
  [[nodiscard]] bool send(std::string_view bytes);
  void set_write_deadline(SteadyTime deadline) { write_deadline_ = deadline; }
  /// Bytes sent so far.
  [[nodiscard]] std::uint64_t bytes_sent() const { return bytes_sent_; }

  [[nodiscard]] int fd() const { return socket_.fd(); }
  [[nodiscard]] const Peer& peer() const { return peer_; }
  [[nodiscard]] bool secure() const { return tls_ != nullptr; }
  /// Makes every transfer fail, also one that another thread waits in.
  void cut();

 private:
  [[nodiscard]] Progress shake_hands();
  [[nodiscard]] Progress read_some();
  [[nodiscard]] bool header_is_whole();
  [[nodiscard]] long write_some(std::string_view bytes, short& wait_for);
  [[nodiscard]] bool wait(short events) const;

  FileHandle socket_;
  Peer peer_;
  ssl_st* tls_;
  std::size_t max_header_bytes_;
  bool in_handshake_;
  std::string buffer_;        ///< what was read
  std::size_t taken_ = 0;     ///< of it, by the parser
  std::size_t searched_ = 0;  ///< of it, for the end of the header
  std::uint64_t bytes_sent_ = 0;
  bool request_begun_ = false;
  SteadyTime deadline_, write_deadline_;
};

}  // namespace mapcodec::daemon
