// SPDX-License-Identifier: GPL-3.0-or-later
// Certificates of a server, for what speaks TLS by OpenSSL.
#pragma once

#include <memory>

#include "mapcodec/base/result.hpp"
#include "tools/mapcodecd/settings.hpp"

struct ssl_ctx_st;
struct ssl_st;

namespace mapcodec::daemon {

/// TLS 1.2 or later. With a client CA every client needs a certificate that it signed. Threads: const methods
/// from many at once.
class TlsContext {
 public:
  /// Errors: InvalidArgument (a certificate without a key, or the other way round; they do not belong
  /// together; expired or not yet good), NotFound (file), Malformed (not PEM).
  [[nodiscard]] static Result<TlsContext> open(const TlsSettings& settings);
  /// The server's end of a connection over `socket`, for SSL_free. nullptr: out of memory.
  [[nodiscard]] ssl_st* accept(int socket) const;

 private:
  explicit TlsContext(ssl_ctx_st* handle) : handle_(handle, &close) {}
  static void close(ssl_ctx_st* handle);
  std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)> handle_;
};

/// Common name of the client's certificate that was verified; empty without one.
[[nodiscard]] std::string peer_common_name(ssl_st* connection);

}  // namespace mapcodec::daemon
