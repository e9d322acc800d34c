// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/wire.hpp"
#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {
namespace {

using Clock = std::chrono::steady_clock;

/// One client's scans. What may be under way is bounded: beyond it nothing is read, and gRPC's flow control
/// stops the client.
class InsertStream final : public grpc::ServerBidiReactor<v1::InsertRequest, v1::InsertReply>,
                           public OpenStream {
 public:
  InsertStream(CallContext& context, CallbackServerContext* grpc)
      : call_(context, *grpc, "Insert"), last_message_(Clock::now()) {
    context.streams.add(this);
    const std::lock_guard lock(mutex_);
    read_more();
  }

  void OnReadDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    last_message_ = Clock::now();
    if (!ok) {
      read_all_ = true;
    } else if (const Status s = take(); !s.ok()) {
      fail(s);
    }
    go_on();
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    if (!ok) fail(make_error(ErrorCode::kCancelled, "the client went away"));
    go_on();
  }

  void OnCancel() override {
    const std::lock_guard lock(mutex_);
    fail(make_error(ErrorCode::kCancelled, "the client gave up"));
    go_on();
  }

  void OnDone() override {
    call_.context.streams.remove(this);
    // Whoever called Finish may still hold the lock.
    { const std::lock_guard lock(mutex_); }
    delete this;
  }

  void wind_up() override {
    const std::lock_guard lock(mutex_);
    fail(make_error(ErrorCode::kUnreachable, "the daemon is about to end"));
    go_on();
  }

  void look_at_clock(Clock::time_point now) override {
    const std::lock_guard lock(mutex_);
    const auto idle = std::chrono::duration<double>(call_.context.settings.idle_stream_s);
    if (under_way_ > 0 || finished_ || now - last_message_ < idle) return;
    // Nothing is lost, and a client that has something again opens another one.
    fail(make_error(ErrorCode::kUnreachable, "the stream sent nothing for too long"));
    go_on();
  }

 private:
  /// The message that was read. Called under the lock.
  Status take() {
    if (!status_.ok()) return {};
    if (request_.has_open()) return open(request_.open());
    if (!request_.has_scan()) return make_error(ErrorCode::kMalformed, "a message without content");
    if (map_.empty()) return make_error(ErrorCode::kMalformed, "the first message opens the stream");
    MAPCODEC_TRY(call_.charge_in(request_.ByteSizeLong()));
    return take_scan(request_.scan());
  }

  Status open(const v1::InsertOpen& open) {
    if (!map_.empty()) return make_error(ErrorCode::kMalformed, "the stream was opened already");
    MAPCODEC_TRY(call_.admit(Right::write, open.map(), CallKind::stream));
    std::uint64_t last = 0;
    MAPCODEC_ASSIGN(last, call_.context.service.last_sequence(open.map(), open.writer()));
    map_ = open.map();
    writer_ = open.writer();
    acknowledged_ = last = std::max(last, open.acknowledged());
    reply_.set_opened(true);
    reply_.set_sequence(last);
    writing_ = true;
    StartWrite(&reply_);
    return {};
  }

  Status take_scan(const v1::InsertScan& message) {
    if (message.sequence() <= last_sequence_)
      return make_error(ErrorCode::kMalformed, "sequence numbers of scans ascend from 1");
    last_sequence_ = message.sequence();
    Scan scan;
    MAPCODEC_ASSIGN(scan.points,
                    wire::read(message.points(), call_.context.service.settings().max_scan_points));
    scan.submap = message.submap();
    if (message.has_t_submap_scan()) {
      MAPCODEC_ASSIGN(scan.T_submap_scan, wire::read(message.t_submap_scan()));
    }
    if (message.has_t_map_submap()) {
      MAPCODEC_ASSIGN(scan.T_map_submap, wire::read(message.t_map_submap()));
    }
    scan.writer = writer_;
    scan.sequence = writer_.empty() ? 0 : message.sequence();
    scan.acknowledged = std::max(acknowledged_, durable_);
    const std::size_t points = scan.points.size();
    const std::uint64_t sequence = message.sequence();
    MAPCODEC_TRY(call_.context.service.insert(map_, std::move(scan),
                                              [this, points, sequence](const Result<ScanReceipt>& receipt) {
                                                committed(points, sequence, receipt);
                                              }));
    ++under_way_;
    points_under_way_ += points;
    return {};
  }

  /// From the map's thread.
  void committed(std::size_t points, std::uint64_t sequence, const Result<ScanReceipt>& receipt) {
    const std::lock_guard lock(mutex_);
    --under_way_;
    points_under_way_ -= points;
    last_message_ = Clock::now();  // until now the client may have waited for this
    if (!receipt.ok()) {
      fail(receipt.error());
    } else if (!durable_broken_) {
      durable_ = sequence;
      revision_ = std::max(revision_, receipt->revision);
    }
    durable_broken_ = durable_broken_ || !receipt.ok();
    go_on();
  }

  void fail(const Status& s) {
    if (status_.ok()) status_ = s;
  }

  /// Whatever can be begun now is begun. Called under the lock; the stream may be gone after it is released.
  void go_on() {
    if (finished_) return;
    if (!writing_ && durable_ > told_ && !call_.rpc.IsCancelled()) {
      told_ = durable_;
      reply_.Clear();
      reply_.set_sequence(durable_);
      reply_.set_revision(revision_);
      writing_ = true;
      StartWrite(&reply_);
    }
    const bool ending = read_all_ || !status_.ok();
    if (ending && under_way_ == 0 && !writing_) {
      finished_ = true;
      Finish(call_.end(status_));
    } else if (!ending) {
      read_more();
    }
  }

  void read_more() {
    if (reading_ || points_under_way_ >= call_.context.settings.stream_window_points) return;
    reading_ = true;
    StartRead(&request_);
  }

  Call call_;
  std::mutex mutex_;
  v1::InsertRequest request_;
  v1::InsertReply reply_;
  std::string map_, writer_;
  std::uint64_t acknowledged_ = 0, last_sequence_ = 0, durable_ = 0, told_ = 0, revision_ = 0;
  std::size_t under_way_ = 0, points_under_way_ = 0;
  bool reading_ = false, writing_ = false, read_all_ = false, finished_ = false, durable_broken_ = false;
  Status status_;
  Clock::time_point last_message_;
};

}  // namespace

grpc::ServerBidiReactor<v1::InsertRequest, v1::InsertReply>* begin_insert(CallContext& context,
                                                                          CallbackServerContext* grpc) {
  return new InsertStream(context, grpc);
}

}  // namespace mapcodec::daemon
