// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/tls/tls_context.hpp"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <unistd.h>

namespace mapcodec::daemon {
namespace {

std::string last_reason() {
  const unsigned long code = ERR_peek_last_error();
  const char* reason = code == 0 ? nullptr : ERR_reason_error_string(code);
  ERR_clear_error();
  return reason == nullptr ? "" : std::string(" (") + reason + ")";
}

Status readable(const std::string& file) {
  if (access(file.c_str(), R_OK) == 0) return {};
  return make_error(ErrorCode::kNotFound, "'" + file + "' cannot be read, or does not exist");
}

Status check_dates(SSL_CTX* context, const std::string& file) {
  const X509* certificate = SSL_CTX_get0_certificate(context);
  if (certificate == nullptr) return make_error(ErrorCode::kMalformed, "'" + file + "' holds no certificate");
  if (X509_cmp_current_time(X509_get0_notAfter(certificate)) < 0) {
    return make_error(ErrorCode::kInvalidArgument, "the certificate in '" + file + "' has expired");
  }
  if (X509_cmp_current_time(X509_get0_notBefore(certificate)) > 0) {
    return make_error(ErrorCode::kInvalidArgument, "the certificate in '" + file + "' is not good yet");
  }
  return {};
}

Status load_server(SSL_CTX* context, const TlsSettings& settings) {
  if (settings.certificate_file.empty() || settings.key_file.empty()) {
    return make_error(ErrorCode::kInvalidArgument, "certificate_file and key_file are given together");
  }
  MAPCODEC_TRY(readable(settings.certificate_file));
  MAPCODEC_TRY(readable(settings.key_file));
  if (SSL_CTX_use_certificate_chain_file(context, settings.certificate_file.c_str()) != 1) {
    return make_error(ErrorCode::kMalformed,
                      "'" + settings.certificate_file + "' is no PEM chain" + last_reason());
  }
  if (SSL_CTX_use_PrivateKey_file(context, settings.key_file.c_str(), SSL_FILETYPE_PEM) != 1 ||
      SSL_CTX_check_private_key(context) != 1) {
    return make_error(ErrorCode::kMalformed,
                      "'" + settings.key_file + "' is no key of the certificate" + last_reason());
  }
  return check_dates(context, settings.certificate_file);
}

Status load_clients(SSL_CTX* context, const std::string& file) {
  if (file.empty()) return {};
  MAPCODEC_TRY(readable(file));
  STACK_OF(X509_NAME)* names = SSL_load_client_CA_file(file.c_str());
  if (names == nullptr || SSL_CTX_load_verify_locations(context, file.c_str(), nullptr) != 1) {
    sk_X509_NAME_pop_free(names, X509_NAME_free);
    return make_error(ErrorCode::kMalformed, "'" + file + "' holds no PEM certificate" + last_reason());
  }
  SSL_CTX_set_client_CA_list(context, names);  // takes the names over
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  return {};
}

}  // namespace

void TlsContext::close(ssl_ctx_st* handle) {
  SSL_CTX_free(handle);
}

Result<TlsContext> TlsContext::open(const TlsSettings& settings) {
  TlsContext context(SSL_CTX_new(TLS_server_method()));
  SSL_CTX* handle = context.handle_.get();
  if (handle == nullptr) return make_error(ErrorCode::kLimitExceeded, "no memory for TLS");
  SSL_CTX_set_min_proto_version(handle, TLS1_2_VERSION);
  SSL_CTX_set_options(handle, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_IGNORE_UNEXPECTED_EOF);
  SSL_CTX_set_mode(
      handle, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER | SSL_MODE_RELEASE_BUFFERS);
  constexpr unsigned char kSessions[] = "mapcodecd";
  SSL_CTX_set_session_id_context(handle, kSessions, sizeof kSessions - 1);
  MAPCODEC_TRY(load_server(handle, settings));
  MAPCODEC_TRY(load_clients(handle, settings.client_ca_file));
  return context;
}

ssl_st* TlsContext::accept(int socket) const {
  SSL* connection = SSL_new(handle_.get());
  if (connection == nullptr) return nullptr;
  if (SSL_set_fd(connection, socket) != 1) {
    SSL_free(connection);
    return nullptr;
  }
  SSL_set_accept_state(connection);
  return connection;
}

std::string peer_common_name(ssl_st* connection) {
  const X509* certificate = SSL_get0_peer_certificate(connection);
  if (certificate == nullptr || SSL_get_verify_result(connection) != X509_V_OK) return {};
  char name[256];
  const int length =
      X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName, name, sizeof name);
  return length <= 0 ? std::string() : std::string(name, static_cast<std::size_t>(length));
}

}  // namespace mapcodec::daemon
