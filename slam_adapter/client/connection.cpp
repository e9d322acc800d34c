// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/connection.hpp"

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "maps/service/error_names.hpp"

namespace mapcodec {
namespace {

Result<std::string> read_pem(const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) return make_error(ErrorCode::kNotFound, path + ": cannot be read");
  return text.str();
}

ErrorCode code_of(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return ErrorCode::kUnreachable;
    case grpc::StatusCode::UNAUTHENTICATED:
      return ErrorCode::kUnauthenticated;
    case grpc::StatusCode::PERMISSION_DENIED:
      return ErrorCode::kDenied;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return ErrorCode::kBusy;
    case grpc::StatusCode::NOT_FOUND:
      return ErrorCode::kNotFound;
    case grpc::StatusCode::CANCELLED:
      return ErrorCode::kCancelled;
    case grpc::StatusCode::UNIMPLEMENTED:
      return ErrorCode::kUnsupported;
    default:
      return ErrorCode::kMalformed;
  }
}

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

ClientSettings ClientSettings::from_environment() {
  ClientSettings s;
  s.token = environment("MAPCODEC_TOKEN");
  s.ca_file = environment("MAPCODEC_CA");
  s.certificate_file = environment("MAPCODEC_CERTIFICATE");
  s.key_file = environment("MAPCODEC_KEY");
  const double timeout = std::atof(environment("MAPCODEC_TIMEOUT").c_str());
  if (timeout > 0) s.timeout_s = timeout;
  return s;
}

void MapClient::Connection::prepare(grpc::ClientContext& context, double timeout_s) const {
  if (!settings.token.empty()) context.AddMetadata("authorization", "Bearer " + settings.token);
  if (timeout_s <= 0) return;
  const auto span = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * timeout_s));
  context.set_deadline(std::chrono::system_clock::now() + span);
}

Error error_of(const grpc::ClientContext& context, const grpc::Status& status, const MapUrl& url) {
  ErrorCode code = code_of(status.error_code());
  const auto& trailing = context.GetServerTrailingMetadata();
  const auto named = trailing.find(kErrorKey);
  if (named != trailing.end()) {
    code = error_of_name({named->second.data(), named->second.size()}).value_or(code);
    return make_error(code, status.error_message());
  }
  return make_error(code, url.address + ": " + status.error_message());
}

MapClient::MapClient(std::shared_ptr<Connection> connection) : connection_(std::move(connection)) {}
MapClient::MapClient(MapClient&&) noexcept = default;
MapClient& MapClient::operator=(MapClient&&) noexcept = default;
MapClient::~MapClient() = default;

const MapUrl& MapClient::url() const {
  return connection_->url;
}

Result<MapClient> MapClient::connect(const std::string& url, const ClientSettings& settings) {
  auto c = std::make_shared<Connection>();
  MAPCODEC_ASSIGN(c->url, parse_map_url(url));
  c->settings = settings;
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(64 << 20);
  arguments.SetMaxSendMessageSize(64 << 20);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);  // how long one attempt may take
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2000);
  auto credentials = grpc::InsecureChannelCredentials();
  if (!settings.ca_file.empty()) {
    grpc::SslCredentialsOptions options;
    MAPCODEC_ASSIGN(options.pem_root_certs, read_pem(settings.ca_file));
    MAPCODEC_ASSIGN(options.pem_cert_chain, read_pem(settings.certificate_file));
    MAPCODEC_ASSIGN(options.pem_private_key, read_pem(settings.key_file));
    credentials = grpc::SslCredentials(options);
  }
  c->channel = grpc::CreateCustomChannel(c->url.address, credentials, arguments);
  c->stub = v1::MapService::NewStub(c->channel);
  return MapClient(std::move(c));
}

}  // namespace mapcodec
