// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/watch_list.hpp"
#include "maps/service/wire.hpp"
#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::size_t kChangesAtOnce = 1000;

/// What differs between what the client has and the newest revision, again and again. What changes while a
/// message is on its way is told with the next one: a slow client gets fewer, larger steps.
class WatchStream final : public grpc::ServerWriteReactor<v1::WatchReply>, public OpenStream {
 public:
  WatchStream(CallContext& context, CallbackServerContext* grpc, const v1::WatchRequest& request)
      : call_(context, *grpc, "Watch"), request_(request), since_(request.since()) {
    context.streams.add(this);
  }

  void begin() {
    Status s = call_.admit(Right::read, request_.map(), CallKind::stream);
    const std::lock_guard lock(mutex_);
    if (s.ok() && !call_.context.steps.try_post([this] { step(); }))
      s = make_error(ErrorCode::kBusy, "too many calls wait");
    busy_ = s.ok();
    if (!s.ok()) end(s);
  }

  void OnWriteDone(bool ok) override {
    const std::lock_guard lock(mutex_);
    if (!ok)
      ending_ = ending_.ok() ? Status(make_error(ErrorCode::kCancelled, "the client went away")) : ending_;
    call_.context.steps.go_on([this] { step(); });
  }
  void OnCancel() override { ask_to_end(make_error(ErrorCode::kCancelled, "the client gave up")); }
  void wind_up() override { ask_to_end(make_error(ErrorCode::kUnreachable, "the daemon is about to end")); }
  void look_at_clock(std::chrono::steady_clock::time_point) override {}
  void OnDone() override {
    call_.context.streams.remove(this);
    watcher_ = nullptr;
    { const std::lock_guard lock(mutex_); }
    delete this;
  }

 private:
  void changed() {
    const std::lock_guard lock(mutex_);
    changed_ = true;
    wake();
  }
  void ask_to_end(const Error& why) {
    const std::lock_guard lock(mutex_);
    if (ending_.ok()) ending_ = why;
    wake();
  }
  void wake() {
    if (busy_ || finished_) return;
    busy_ = true;
    call_.context.steps.go_on([this] { step(); });
  }
  void end(const Status& s) {
    finished_ = true;
    Finish(call_.end(s));
  }

  /// In a thread of the pool, one at a time: `busy_` stays true from its beginning to the end of its write.
  void step() {
    Result<bool> more = watcher_ == nullptr ? start() : Result<bool>(true);
    if (more.ok()) more = make_reply();
    const std::lock_guard lock(mutex_);
    if (!ending_.ok()) {
      end(ending_);
    } else if (!more.ok()) {
      end(more.error());
    } else if (*more) {
      StartWrite(&reply_);
    } else if (request_.once()) {
      end({});
    } else if (changed_) {
      call_.context.steps.go_on([this] { step(); });
    } else {
      busy_ = false;
    }
  }

  Result<bool> start() {
    MAPCODEC_ASSIGN(watcher_, call_.context.service.watch(request_.map(), [this] { changed(); }));
    return true;
  }

  /// @return false: the client has everything.
  Result<bool> make_reply() {
    reply_.Clear();
    if (next_ == changes_.size()) {
      {
        const std::lock_guard lock(mutex_);
        changed_ = false;  // before looking
      }
      MAPCODEC_ASSIGN(view_, call_.context.service.view(request_.map()));
      if (told_ && view_->archive->revision() == since_) return false;
      MAPCODEC_TRY(find_changes());
    }
    reply_.set_revision(view_->archive->revision());
    reply_.set_reset(reset_);
    const std::size_t end = std::min(changes_.size(), next_ + kChangesAtOnce);
    for (; next_ < end; ++next_) wire::write(changes_[next_], *reply_.add_changes());
    if (next_ < changes_.size()) return true;
    reply_.set_complete(true);
    wire::write(*view_->archive, *reply_.mutable_facts());
    since_ = view_->archive->revision();
    told_ = true;
    return true;
  }

  Status find_changes() {
    next_ = 0;
    auto changes = changes_since(*view_->archive, since_);
    const bool gone = !changes.ok() && (changes.error().code == ErrorCode::kNotFound ||
                                        changes.error().code == ErrorCode::kInvalidArgument);
    reset_ = gone || since_ == 0;
    if (gone) changes = changes_since(*view_->archive, 0);
    if (!changes.ok()) return changes.error();
    changes_ = std::move(changes).value();
    return {};
  }

  Call call_;
  const v1::WatchRequest request_;
  std::mutex mutex_;
  bool busy_ = false, changed_ = false, finished_ = false;
  Status ending_;
  // Of the step at work:
  std::unique_ptr<MapService::Watcher> watcher_;
  MapViewPtr view_;
  std::vector<TileChange> changes_;
  std::size_t next_ = 0;
  std::uint64_t since_;
  bool reset_ = false, told_ = false;
  v1::WatchReply reply_;
};

class DiffStream final : public ReplyStream<v1::DiffReply> {
 public:
  DiffStream(CallContext& context, CallbackServerContext* grpc, const v1::DiffRequest& request)
      : ReplyStream(context, grpc, "Diff"), request_(request) {}

 private:
  Result<bool> next(v1::DiffReply& reply) override {
    if (to_ == nullptr) {
      MapService& service = call().context.service;
      MAPCODEC_ASSIGN(const MapViewPtr newest, service.view(request_.map()));
      MAPCODEC_ASSIGN(to_, service.view(request_.map(), request_.to()));
      MAPCODEC_ASSIGN(const std::uint64_t from, newest->archive->resolve(request_.from()));
      MAPCODEC_ASSIGN(const MapArchive before, to_->archive->at(from));
      from_ = before.revision();
      MAPCODEC_ASSIGN(changes_, diff_maps(before, *to_->archive, true));
    } else if (next_ == changes_.size()) {
      return false;
    }
    reply.set_from(from_);
    reply.set_to(to_->archive->revision());
    const std::size_t end = std::min(changes_.size(), next_ + kChangesAtOnce);
    for (; next_ < end; ++next_) wire::write(changes_[next_], *reply.add_changes());
    return true;
  }

  const v1::DiffRequest request_;
  MapViewPtr to_;
  std::uint64_t from_ = 0;
  std::vector<TileChange> changes_;
  std::size_t next_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::WatchReply>* begin_watch(CallContext& context, CallbackServerContext* grpc,
                                                      const v1::WatchRequest& request) {
  auto* stream = new WatchStream(context, grpc, request);
  stream->begin();
  return stream;
}

grpc::ServerWriteReactor<v1::DiffReply>* begin_diff(CallContext& context, CallbackServerContext* grpc,
                                                    const v1::DiffRequest& request) {
  auto* stream = new DiffStream(context, grpc, request);
  stream->begin(Right::read, request.map(), request.ByteSizeLong());
  return stream;
}

}  // namespace mapcodec::daemon
