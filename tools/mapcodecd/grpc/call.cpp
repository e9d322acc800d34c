// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/call.hpp"

#include "maps/service/error_names.hpp"

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
  constexpr const char* kNames[] = {"OK", "CANCELLED", "UNKNOWN", "INVALID_ARGUMENT", "DEADLINE_EXCEEDED",
                                    "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED",
                                    "FAILED_PRECONDITION", "ABORTED", "OUT_OF_RANGE", "UNIMPLEMENTED",
                                    "INTERNAL", "UNAVAILABLE", "DATA_LOSS", "UNAUTHENTICATED"};
  const auto i = static_cast<std::size_t>(code);
  return i < std::size(kNames) ? kNames[i] : "UNKNOWN";
}

std::string bearer_token(const grpc::CallbackServerContext& grpc) {
  const auto& metadata = grpc.client_metadata();
  const auto at = metadata.find("authorization");
  if (at == metadata.end()) return {};
  const std::string_view value(at->second.data(), at->second.size());
  constexpr std::string_view kScheme = "Bearer ";
  const bool bearer = value.size() > kScheme.size() &&
                      std::equal(kScheme.begin(), kScheme.end(), value.begin(), [](char a, char b) {
                        return std::tolower(static_cast<unsigned char>(a)) ==
                               std::tolower(static_cast<unsigned char>(b));
                      });
  return bearer ? std::string(value.substr(kScheme.size())) : std::string();
}

bool is_local(const std::string& peer) {
  for (const char* prefix : {"unix:", "ipv4:127.", "ipv6:[::1]", "ipv6:%5B::1%5D"}) {
    if (peer.rfind(prefix, 0) == 0) return true;
  }
  return false;
}

Credentials credentials_of(const grpc::CallbackServerContext& grpc) {
  Credentials who;
  who.token = bearer_token(grpc);
  who.peer = grpc.peer();
  who.local = is_local(who.peer);
  if (const auto auth = grpc.auth_context(); auth != nullptr && auth->IsPeerAuthenticated()) {
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
  context.metrics.add(ServiceMetrics::Counter::bytes_in, double(bytes));
  return {};
}

Status Call::charge_out(std::uint64_t bytes) {
  MAPCODEC_TRY(admission_->charge(bytes));
  context.metrics.add(ServiceMetrics::Counter::bytes_out, double(bytes));
  return {};
}

grpc::Status Call::end(const Status& s) {
  admission_ = nullptr;
  const auto code = s.ok() ? grpc::StatusCode::OK : code_of(s.error().code);
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  context.metrics.request("grpc", method_, name_of(code), took);
  if (s.ok()) return grpc::Status::OK;
  rpc.AddTrailingMetadata(kErrorKey, std::string(error_name(s.error().code)));
  if (code == grpc::StatusCode::RESOURCE_EXHAUSTED) {
    const bool disk = s.error().code == ErrorCode::kCannotWrite;
    rpc.AddTrailingMetadata(kRetryKey, std::to_string(disk ? 2000 : context.service.retry_after_ms()));
  }
  return {code, s.error().to_string()};
}

}  // namespace mapcodec::daemon
