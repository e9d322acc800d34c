// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/call.hpp"

#include <grpc/grpc_security_constants.h>

#include "maps/service/error_names.hpp"
#include "maps/service/tokens.hpp"

namespace mapcodec::daemon {
namespace {

grpc::StatusCode code_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kEmpty:
    case ErrorCode::kTruncated:
    case ErrorCode::kMalformed:
    case ErrorCode::kLimitExceeded:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case ErrorCode::kNotFound:
      return grpc::StatusCode::NOT_FOUND;
    case ErrorCode::kUnsupported:
      return grpc::StatusCode::UNIMPLEMENTED;
    case ErrorCode::kUnknownCodec:
    case ErrorCode::kChecksumMismatch:
    case ErrorCode::kArchiveDamaged:
      return grpc::StatusCode::DATA_LOSS;
    case ErrorCode::kCannotWrite:
    case ErrorCode::kBusy:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case ErrorCode::kCancelled:
      return grpc::StatusCode::CANCELLED;
    case ErrorCode::kUnreachable:
      return grpc::StatusCode::UNAVAILABLE;
    case ErrorCode::kUnauthenticated:
      return grpc::StatusCode::UNAUTHENTICATED;
    case ErrorCode::kDenied:
      return grpc::StatusCode::PERMISSION_DENIED;
    case ErrorCode::kExists:
      return grpc::StatusCode::ALREADY_EXISTS;
    default:
      return grpc::StatusCode::INTERNAL;
  }
}

const char* name_of(grpc::StatusCode code) {
  constexpr const char* kNames[] = {
      "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
      "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
      "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
      "DATA_LOSS", "UNAUTHENTICATED"};
  const auto i = static_cast<std::size_t>(code);
  return i < std::size(kNames) ? kNames[i] : "UNKNOWN";
}

/// The first value of a key of the client's metadata; empty without one.
std::string_view metadata_value(const grpc::CallbackServerContext& grpc, const char* key) {
  const auto at = grpc.client_metadata().find(key);
  return at == grpc.client_metadata().end() ? std::string_view()
                                            : std::string_view(at->second.data(), at->second.size());
}

bool is_local(const std::string& peer) {
  for (const char* prefix : {"unix:", "ipv4:127.", "ipv6:[::1]", "ipv6:%5B::1%5D"}) {
    if (peer.rfind(prefix, 0) == 0) return true;
  }
  return false;
}

Credentials credentials_of(const grpc::CallbackServerContext& grpc) {
  Credentials who;
  who.token = bearer_token(metadata_value(grpc, "authorization"));
  who.peer = grpc.peer();
  const auto auth = grpc.auth_context();
  const auto transport = auth == nullptr
                             ? std::vector<grpc::string_ref>()
                             : auth->FindPropertyValues(GRPC_TRANSPORT_SECURITY_TYPE_PROPERTY_NAME);
  const bool secure = !transport.empty() && transport.front() == GRPC_SSL_TRANSPORT_SECURITY_TYPE;
  who.local = !secure && is_local(who.peer);  // a proxy that speaks TLS to us may stand on this machine
  if (auth != nullptr && auth->IsPeerAuthenticated()) {
    const auto names = auth->FindPropertyValues("x509_common_name");
    if (!names.empty()) who.peer_subject.assign(names.front().data(), names.front().size());
  }
  return who;
}

}  // namespace

Status Call::admit(Right right, const std::string& map, CallKind kind) {
  if (context.stopping) return make_error(ErrorCode::kUnreachable, "the daemon is about to end");
  who_ = credentials_of(rpc);
  MAPCODEC_ASSIGN(admission_, context.access.admit(who_, right, map, kind));
  return {};
}

const std::string& Call::principal() const {
  static const std::string nobody = "nobody";
  return admission_ == nullptr ? nobody : admission_->principal();
}

Status Call::charge_in(std::uint64_t bytes) {
  MAPCODEC_TRY(admission_->charge(bytes));
  bytes_in_ += bytes;
  context.metrics.add(ServiceMetrics::Counter::bytes_in, double(bytes));
  return {};
}

Status Call::charge_out(std::uint64_t bytes) {
  MAPCODEC_TRY(admission_->charge(bytes));
  bytes_out_ += bytes;
  context.metrics.add(ServiceMetrics::Counter::bytes_out, double(bytes));
  return {};
}

void Call::record(const std::string& code, const Status& s, double seconds) {
  const std::string id = request_id(metadata_value(rpc, "x-request-id"));
  rpc.AddTrailingMetadata("x-request-id", id);
  if (!context.record) return;
  context.record({id, "grpc", method_, code, admission_ == nullptr ? "" : admission_->principal(), who_.peer,
                  s.ok() ? "" : s.error().to_string(), bytes_in_, bytes_out_, seconds});
}

grpc::Status Call::end(const Status& s) {
  const auto code = s.ok() ? grpc::StatusCode::OK : code_of(s.error().code);
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  context.metrics.request("grpc", method_, name_of(code), took);
  record(name_of(code), s, took);
  admission_ = nullptr;
  if (s.ok()) return grpc::Status::OK;
  rpc.AddTrailingMetadata(kErrorKey, std::string(error_name(s.error().code)));
  if (code == grpc::StatusCode::RESOURCE_EXHAUSTED) {
    const bool disk = s.error().code == ErrorCode::kCannotWrite;
    rpc.AddTrailingMetadata(kRetryKey, std::to_string(disk ? 2000 : context.service.retry_after_ms()));
  }
  return {code, s.error().to_string()};
}

}  // namespace mapcodec::daemon
