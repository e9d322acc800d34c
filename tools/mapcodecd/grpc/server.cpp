// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/server.hpp"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tools/mapcodecd/config/listen_address.hpp"
#include "tools/mapcodecd/grpc/acceptor.hpp"
#include "tools/mapcodecd/grpc/map_calls.hpp"
#include "tools/mapcodecd/tls/tls_context.hpp"

namespace mapcodec::daemon {
namespace {

bool is_socket(const ListenAddress& a) {
  return a.kind == ListenAddress::Kind::unix_socket;
}

Result<std::string> read_pem(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) return make_error(ErrorCode::kNotFound, path + ": cannot be read");
  if (text.str().find("-----BEGIN") == std::string::npos)
    return make_error(ErrorCode::kMalformed, path + ": is no PEM file");
  return text.str();
}

Result<std::shared_ptr<grpc::ServerCredentials>> credentials_for(const ListenAddress& address,
                                                                 const TlsSettings& tls) {
  if (is_socket(address) || !tls.enabled()) return grpc::InsecureServerCredentials();
  grpc::SslServerCredentialsOptions options(GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE);
  grpc::SslServerCredentialsOptions::PemKeyCertPair pair;
  MAPCODEC_ASSIGN(pair.private_key, read_pem(tls.key_file));
  MAPCODEC_ASSIGN(pair.cert_chain, read_pem(tls.certificate_file));
  options.pem_key_cert_pairs.push_back(pair);
  if (!tls.client_ca_file.empty()) {
    MAPCODEC_ASSIGN(options.pem_root_certs, read_pem(tls.client_ca_file));
    options.client_certificate_request = GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY;
  }
  return grpc::SslServerCredentials(options);
}

/// What gRPC would find out with the first connection, and tell nobody.
Status check_certificates(const TlsSettings& tls) {
  const auto context = TlsContext::open(tls);
  return context.ok() ? Status() : Status(context.error());
}

void set_limits(grpc::ServerBuilder& builder, const GrpcSettings& s) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(s.max_message_bytes));
  // gRPC looks at a message's size once all of it is there: this is what bounds those that never end.
  builder.SetResourceQuota(grpc::ResourceQuota("mapcodecd").Resize(s.memory_bytes));
  builder.SetMaxSendMessageSize(static_cast<int>(s.max_message_bytes));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, static_cast<int>(s.max_streams_per_connection));
  builder.AddChannelArgument("grpc.server_handshake_timeout_ms", static_cast<int>(1000 * s.handshake_s));
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, 16384);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 30000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  // A connection without a call gives its place to others; clients connect again without being asked.
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, static_cast<int>(1000 * s.idle_connection_s));
  // A frame of 16 KiB each costs more than the bytes do.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_FRAME_SIZE, 1 << 20);
}

}  // namespace

struct GrpcServer::Impl {
  Impl(const GrpcSettings& s, MapService& m, AccessControl& a, ServiceMetrics& k, RecordRequest r)
      : settings(s),
        pool(s.workers, s.waiting_calls),
        steps(s.workers, s.waiting_calls),
        context{settings, m, a, k, pool, steps, streams, stopping, std::move(r)},
        calls(context),
        acceptor(s.max_connections) {}

  Status listen(grpc::ServerBuilder& builder);
  void watch_clock();

  const GrpcSettings settings;
  std::atomic<bool> stopping{false};
  StreamList streams;
  WorkerPool pool, steps;
  CallContext context;
  MapCalls calls;
  std::vector<std::string> addresses;
  std::unique_ptr<grpc::Server> server;
  ConnectionAcceptor acceptor;  ///< after the server: ends before it
  std::mutex mutex;
  std::condition_variable wake;
  bool ended = false;
  std::thread clock;
};

Status GrpcServer::Impl::listen(grpc::ServerBuilder& builder) {
  if (settings.tls.enabled()) MAPCODEC_TRY(check_certificates(settings.tls));
  for (const std::string& text : settings.listen) {
    MAPCODEC_ASSIGN(const ListenAddress address, parse_listen_address(text));
    MAPCODEC_TRY(check_listen(address, settings.tls.enabled(), settings.insecure));
    MAPCODEC_ASSIGN(const auto credentials, credentials_for(address, settings.tls));
    MAPCODEC_ASSIGN(ListeningSocket socket, listen_on(address));
    addresses.push_back(socket.address.to_string());
    const std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor> door =
        builder.experimental().AddExternalConnectionAcceptor(
            grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, credentials);
    acceptor.add(std::move(socket), [door](int fd) {
      grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
      connection.fd = fd;
      door->HandleNewConnection(&connection);
    });
  }
  return {};
}

void GrpcServer::Impl::watch_clock() {
  std::unique_lock lock(mutex);
  while (!wake.wait_for(lock, std::chrono::seconds(1), [&] { return ended; })) {
    const auto now = std::chrono::steady_clock::now();
    streams.each([&](OpenStream& s) { s.look_at_clock(now); });
  }
}

GrpcServer::GrpcServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Result<std::unique_ptr<GrpcServer>> GrpcServer::start(const GrpcSettings& settings, MapService& service,
                                                      AccessControl& access, ServiceMetrics& metrics,
                                                      RecordRequest record) {
  static const bool plugins = [] {
    // What clients send wrong is told to them; lines of others' libraries would break a log of JSON lines.
    google::protobuf::SetLogHandler(nullptr);
    if (std::getenv("GRPC_VERBOSITY") == nullptr) gpr_set_log_function([](gpr_log_func_args*) {});
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  (void)plugins;
  try {
    auto impl = std::make_unique<Impl>(settings, service, access, metrics, std::move(record));
    grpc::ServerBuilder builder;
    set_limits(builder, settings);
    MAPCODEC_TRY(impl->listen(builder));
    builder.RegisterService(&impl->calls);
    impl->server = builder.BuildAndStart();
    if (impl->server == nullptr)
      return make_error(ErrorCode::kCannotWrite,
                        settings.listen.front() + ": gRPC cannot start (or bad certificates)");
    impl->acceptor.start();
    impl->clock = std::thread([i = impl.get()] { i->watch_clock(); });
    return std::unique_ptr<GrpcServer>(new GrpcServer(std::move(impl)));
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kCannotWrite, std::string("the server cannot start: ") + e.what());
  }
}

GrpcServer::~GrpcServer() {
  stop(std::chrono::system_clock::now());
}

const std::vector<std::string>& GrpcServer::addresses() const {
  return impl_->addresses;
}

void GrpcServer::set_serving(bool serving) {
  impl_->server->GetHealthCheckService()->SetServingStatus(serving);
}

void GrpcServer::stop(std::chrono::system_clock::time_point deadline) {
  if (impl_->stopping.exchange(true)) return;
  impl_->server->GetHealthCheckService()->SetServingStatus(false);
  impl_->acceptor.stop();
  impl_->streams.each([](OpenStream& s) { s.wind_up(); });
  impl_->server->Shutdown(deadline);
  impl_->server->Wait();
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->ended = true;
  }
  impl_->wake.notify_one();
  impl_->clock.join();
}

}  // namespace mapcodec::daemon
