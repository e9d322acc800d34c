// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/http_server.hpp"

#include <httplib.h>

#include <algorithm>

#include "maps/service/tokens.hpp"
#include "tools/mapcodecd/http/map_routes.hpp"

namespace mapcodec::daemon {
namespace {

/// What cpp-httplib reads from and writes to. The header is there before it is asked to parse, so reading
/// never waits.
class ConnectionStream final : public httplib::Stream {
 public:
  explicit ConnectionStream(Connection& connection) : connection_(connection) {}
  [[nodiscard]] bool is_readable() const override { return true; }
  [[nodiscard]] bool is_writable() const override { return true; }
  ssize_t read(char* out, size_t size) override { return static_cast<ssize_t>(connection_.take(out, size)); }
  ssize_t write(const char* bytes, size_t size) override {
    return connection_.send({bytes, size}) ? static_cast<ssize_t>(size) : -1;
  }
  void get_remote_ip_and_port(std::string& ip, int& port) const override {
    ip = connection_.peer().name;
    port = 0;
  }
  void get_local_ip_and_port(std::string& ip, int& port) const override {
    ip.clear();
    port = 0;
  }
  [[nodiscard]] socket_t socket() const override { return connection_.fd(); }

 private:
  Connection& connection_;
};

/// What cpp-httplib would do on its own and must not: compress (brotli at its highest level takes seconds),
/// answer ranges (it does not cut them to the entity), and read bodies.
void prepare(httplib::Request& request) {
  request.ranges.clear();
  request.headers.erase("Accept-Encoding");
}

bool has_body(const httplib::Request& request) {
  return request.has_header("Transfer-Encoding") ||
         (request.has_header("Content-Length") && request.get_header_value("Content-Length") != "0");
}

HttpQuestion question_of(const httplib::Request& request, const Peer& peer) {
  HttpQuestion q;
  q.method = request.method;
  q.path = request.path;
  q.revision = request.get_param_value("revision");
  q.if_none_match = request.get_header_value("If-None-Match");
  // A range of what the client has seen before; whether it is still that is not compared: the whole is right,
  // too.
  if (!request.has_header("If-Range")) q.range = request.get_header_value("Range");
  q.who = {std::string(bearer_token(request.get_header_value("Authorization"))), peer.name, peer.subject,
           peer.local};
  return q;
}

/// Sends the parts from their place in memory.
void set_body(HttpAnswer& answer, httplib::Response& response) {
  const std::uint64_t size = answer.size();
  if (size == 0) return;
  auto parts = std::make_shared<const std::vector<SharedBytes>>(std::move(answer.body));
  response.set_content_provider(
      size, answer.content_type, [parts](std::size_t offset, std::size_t, httplib::DataSink& sink) {
        for (const SharedBytes& part : *parts) {
          if (offset < part.bytes.size()) {
            return sink.write(part.bytes.data() + offset, part.bytes.size() - offset);
          }
          offset -= part.bytes.size();
        }
        return false;
      });
}

/// cpp-httplib's parser and writer over connections that are not its own.
class Parser final : public httplib::Server {
 public:
  explicit Parser(const HttpSettings& settings) {
    svr_sock_ = 0;  // it has no socket of its own, but takes the lack of one for the end of the server
    // What it tells clients; the listener keeps it.
    set_keep_alive_timeout(static_cast<time_t>(settings.idle_timeout_s));
    set_keep_alive_max_count(1000000);
  }
  /// @param close  becomes true when the client or the answer ends the connection.
  [[nodiscard]] bool answer(Connection& connection, bool& close) {
    ConnectionStream stream(connection);
    return process_request(stream, false, close, prepare);
  }
};

/// The request that this thread is at work on.
struct AtWork {
  Connection* connection = nullptr;
  RequestRecord record;
  std::string route;
  bool close = false;
};
thread_local AtWork at_work;

}  // namespace

struct HttpServer::Impl {
  Impl(const HttpSettings& settings, MapService& service, AccessControl& access, ServiceMetrics& m,
       HttpHooks h)
      : metrics(m), hooks(std::move(h)), routes(service, access, metrics, hooks), parser(settings) {
    parser.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      handle(request, response);
      return httplib::Server::HandlerResponse::Handled;
    });
  }

  ServiceMetrics& metrics;
  const HttpHooks hooks;
  MapRoutes routes;
  Parser parser;
  std::unique_ptr<HttpListener> listener;  ///< last: its threads use the others

  void handle(const httplib::Request& request, httplib::Response& response);
  [[nodiscard]] HttpAnswer answer(const httplib::Request& request);
  [[nodiscard]] bool serve(Connection& connection);
};

HttpAnswer HttpServer::Impl::answer(const httplib::Request& request) {
  try {
    return routes.answer(question_of(request, at_work.connection->peer()));
  } catch (const std::bad_alloc&) {
    return plain_answer(503, "out of memory");
  } catch (const std::exception&) {
    return plain_answer(500, "internal error");
  }
}

void HttpServer::Impl::handle(const httplib::Request& request, httplib::Response& response) {
  HttpAnswer made = answer(request);
  at_work.record.id = request_id(request.get_header_value("X-Request-Id"));
  at_work.record.method = request.method + " " + request.path;
  at_work.record.principal = made.principal;
  at_work.record.code = std::to_string(made.status);
  at_work.record.error = made.error;
  at_work.route = made.route;
  at_work.close = has_body(request) || made.status == 405;  // a body is not read: what follows is no request
  response.status = made.status;
  for (const auto& [name, value] : made.headers) response.set_header(name, value);
  response.set_header("X-Request-Id", at_work.record.id);
  if (at_work.close) response.set_header("Connection", "close");
  set_body(made, response);
}

bool HttpServer::Impl::serve(Connection& connection) {
  const auto begin = std::chrono::steady_clock::now();
  const std::uint64_t sent_before = connection.bytes_sent();
  at_work = {&connection, {}, "other", false};
  at_work.record.code = "400";  // what the parser says of what it cannot read
  bool close = false, good = false;
  try {
    good = parser.answer(connection, close);
  } catch (const std::exception&) {
    at_work.record.code = "500";
  }
  RequestRecord& record = at_work.record;
  record.transport = "http";
  record.peer = connection.peer().name;
  record.bytes_out = connection.bytes_sent() - sent_before;
  record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  metrics.request("http", at_work.route, record.code, record.seconds);
  if (hooks.record) hooks.record(record);
  return good && !close && !at_work.close && !record.id.empty();
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;

Result<std::unique_ptr<HttpServer>> HttpServer::start(const HttpSettings& settings, MapService& service,
                                                      AccessControl& access, ServiceMetrics& metrics,
                                                      HttpHooks hooks) {
  auto impl = std::make_unique<Impl>(settings, service, access, metrics, std::move(hooks));
  Impl* shared = impl.get();
  MAPCODEC_ASSIGN(impl->listener,
                  HttpListener::start(settings, [shared](Connection& c) { return shared->serve(c); }));
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

const std::vector<std::string>& HttpServer::addresses() const {
  return impl_->listener->addresses();
}
HttpListener::Figures HttpServer::figures() const {
  return impl_->listener->figures();
}
void HttpServer::set_serving(bool serving) {
  impl_->routes.set_serving(serving);
}
void HttpServer::stop(SteadyTime deadline) {
  impl_->listener->stop(deadline);
}

}  // namespace mapcodec::daemon
