// SPDX-License-Identifier: GPL-3.0-or-later
// What all calls have in common: who calls, whether they may, how it ended.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <set>

#include "maps/service/access.hpp"
#include "maps/service/map_service.hpp"
#include "maps/service/v1/map_service.grpc.pb.h"
#include "tools/mapcodecd/grpc/worker_pool.hpp"
#include "tools/mapcodecd/request_record.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// A call that lasts: may be asked to end, and is cut off if its client does nothing.
class OpenStream {
 public:
  virtual ~OpenStream() = default;
  /// The daemon ends: finish what is promised, and say so.
  virtual void wind_up() = 0;
  /// Called about once a second.
  virtual void look_at_clock(std::chrono::steady_clock::time_point now) = 0;
};

/// Threads: from many at once.
class StreamList {
 public:
  void add(OpenStream* s) {
    const std::lock_guard lock(mutex_);
    streams_.insert(s);
  }
  void remove(OpenStream* s) {
    const std::lock_guard lock(mutex_);
    streams_.erase(s);
  }
  /// No stream goes away meanwhile.
  void each(const std::function<void(OpenStream&)>& f) {
    const std::lock_guard lock(mutex_);
    for (OpenStream* s : streams_) f(*s);
  }

 private:
  std::mutex mutex_;
  std::set<OpenStream*> streams_;
};

/// What calls need of the server.
struct CallContext {
  const GrpcSettings& settings;
  MapService& service;
  AccessControl& access;
  ServiceMetrics& metrics;
  WorkerPool& pool;   ///< for calls that may wait long
  WorkerPool& steps;  ///< for streams: each step is short
  StreamList& streams;
  std::atomic<bool>& stopping;
  RecordRequest record;  ///< may be empty
};

/// One call from its beginning to its end. Threads: one at a time.
class Call {
 public:
  Call(CallContext& of_server, grpc::CallbackServerContext& of_grpc, const char* method)
      : context(of_server), rpc(of_grpc), method_(method), begin_(std::chrono::steady_clock::now()) {}

  /// Errors: as AccessControl::admit; Busy (the daemon ends).
  [[nodiscard]] Status admit(Right right, const std::string& map, CallKind kind);
  /// Counts bytes that came or go. Errors: Busy.
  [[nodiscard]] Status charge_in(std::uint64_t bytes);
  [[nodiscard]] Status charge_out(std::uint64_t bytes);
  /// gRPC's status for `s`; adds the trailing metadata, and counts the call as ended.
  [[nodiscard]] grpc::Status end(const Status& s);
  [[nodiscard]] const std::string& principal() const;
  [[nodiscard]] const Credentials& credentials() const { return who_; }

  CallContext& context;
  grpc::CallbackServerContext& rpc;

 private:
  /// Tells the client the number of its call, and the log how it ended.
  void record(const std::string& code, const Status& s, double seconds);
  const char* method_;
  std::chrono::steady_clock::time_point begin_;
  Credentials who_;
  std::unique_ptr<Admission> admission_;
  std::uint64_t bytes_in_ = 0, bytes_out_ = 0;
};

/// Answers in one message, made by a thread of the pool.
/// @param map  that the right is for. @param body  Status(Call&)
template <class Body>
grpc::ServerUnaryReactor* answer(CallContext& context, grpc::CallbackServerContext* grpc, const char* method,
                                 Right right, const std::string& map, std::size_t request_bytes, Body body) {
  auto* reactor = grpc->DefaultReactor();
  auto call = std::make_shared<Call>(context, *grpc, method);
  Status s = call->admit(right, map, CallKind::unary);
  if (s.ok()) s = call->charge_in(request_bytes);
  const auto work = [call, reactor, body]() mutable {
    if (call->rpc.IsCancelled()) {
      reactor->Finish(call->end(make_error(ErrorCode::kCancelled, "the client gave up")));
      return;
    }
    reactor->Finish(call->end(body(*call)));
  };
  if (s.ok() && !context.pool.try_post(work)) s = make_error(ErrorCode::kBusy, "too many calls wait");
  if (!s.ok()) reactor->Finish(call->end(s));
  return reactor;
}

/// A stream of answers, one made when the one before was taken: a reader that is slow costs one message.
template <class Reply>
class ReplyStream : public grpc::ServerWriteReactor<Reply>, public OpenStream {
 public:
  ReplyStream(CallContext& context, grpc::CallbackServerContext* grpc, const char* method)
      : call_(context, *grpc, method) {
    context.streams.add(this);
  }
  void begin(Right right, const std::string& map, std::size_t request_bytes) {
    Status s = call_.admit(right, map, CallKind::stream);
    if (s.ok()) s = call_.charge_in(request_bytes);
    if (s.ok() && !call_.context.steps.try_post([this] { step(); }))
      s = make_error(ErrorCode::kBusy, "too many calls wait");
    if (!s.ok()) this->Finish(call_.end(s));
  }

  void OnWriteDone(bool ok) override {
    waits_since_ = std::chrono::steady_clock::time_point::max();
    if (!ok) {
      this->Finish(call_.end(make_error(ErrorCode::kCancelled, "the client went away")));
    } else if (light_) {
      step();
    } else {
      call_.context.steps.go_on([this] { step(); });
    }
  }
  void OnDone() override {
    call_.context.streams.remove(this);
    delete this;
  }
  void wind_up() override {}
  void look_at_clock(std::chrono::steady_clock::time_point now) override {
    const auto since = waits_since_.load();
    const bool waits = since != std::chrono::steady_clock::time_point::max() && now > since;
    if (waits && now - since > std::chrono::duration<double>(4 * call_.context.settings.idle_stream_s))
      call_.rpc.TryCancel();
  }

 protected:
  /// Fills the next answer. @return false: there is none, the stream ends. May be called in any thread, one
  /// at a time.
  [[nodiscard]] virtual Result<bool> next(Reply& reply) = 0;
  /// `next` takes so little that gRPC's threads may do it.
  void set_light(bool light) { light_ = light; }
  Call& call() { return call_; }

 private:
  void step() {
    reply_.Clear();
    Result<bool> more = call_.rpc.IsCancelled()
                            ? Result<bool>(make_error(ErrorCode::kCancelled, "the client gave up"))
                            : next(reply_);
    if (more.ok() && *more) {
      if (const Status s = call_.charge_out(reply_.ByteSizeLong()); !s.ok()) more = s.error();
    }
    if (more.ok() && *more) {
      waits_since_ = std::chrono::steady_clock::now();
      this->StartWrite(&reply_);
    } else {
      this->Finish(call_.end(more.ok() ? Status() : Status(more.error())));
    }
  }

  Call call_;
  Reply reply_;
  bool light_ = false;
  std::atomic<std::chrono::steady_clock::time_point> waits_since_{
      std::chrono::steady_clock::time_point::max()};
};

}  // namespace mapcodec::daemon
