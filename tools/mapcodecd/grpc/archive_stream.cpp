// SPDX-License-Identifier: GPL-3.0-or-later
// Archives as they lie: out in ranges, in as a whole.
#include <unistd.h>

#include <cstdio>

#include "maps/service/wire.hpp"
#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::uint64_t kPartBytes = std::uint64_t{1} << 20;

class ReadArchiveStream final : public ReplyStream<v1::ReadArchiveReply> {
 public:
  ReadArchiveStream(CallContext& context, CallbackServerContext* grpc, const v1::ReadArchiveRequest& request)
      : ReplyStream(context, grpc, "ReadArchive"), request_(request) {
    set_light(true);
  }

 private:
  Result<bool> next(v1::ReadArchiveReply& reply) override {
    if (view_ == nullptr) {
      MAPCODEC_TRY(open());
      reply.set_file(view_->file);
      reply.set_file_bytes(view_->archive->file_bytes());
    } else if (at_ == end_) {
      return false;
    }
    const std::uint64_t size = std::min(kPartBytes, end_ - at_);
    if (size == 0) return true;
    MAPCODEC_ASSIGN(const Bytes bytes, view_->archive->store().read(at_, size));
    reply.set_data(bytes.data(), bytes.size());
    at_ += size;
    return true;
  }

  Status open() {
    MapService& service = call().context.service;
    if (request_.file() == 0) {
      MAPCODEC_ASSIGN(view_, service.view(request_.map()));
    } else {
      MAPCODEC_ASSIGN(view_, service.view_of_file(request_.map(), request_.file()));
    }
    const std::uint64_t whole = view_->archive->file_bytes();
    at_ = request_.offset();
    const std::uint64_t left = at_ <= whole ? whole - at_ : 0;
    if (at_ > whole || request_.length() > left)
      return make_error(ErrorCode::kInvalidArgument,
                        "the archive has only " + std::to_string(whole) + " bytes");
    end_ = request_.length() == 0 ? whole : at_ + request_.length();
    return {};
  }

  const v1::ReadArchiveRequest request_;
  MapViewPtr view_;
  std::uint64_t at_ = 0, end_ = 0;
};

/// Bytes of an archive into a file beside the maps, under a name that none has; then the service looks at it.
class UploadStream final : public grpc::ServerReadReactor<v1::UploadRequest>, public OpenStream {
 public:
  UploadStream(CallContext& context, CallbackServerContext* grpc, v1::RevisionReply* reply)
      : call_(context, *grpc, "Upload"), reply_(*reply), last_message_(now_ns()) {
    context.streams.add(this);
    StartRead(&request_);
  }
  ~UploadStream() override { discard(); }

  void OnReadDone(bool ok) override {
    last_message_ = now_ns();
    if (!ok) {
      call_.context.pool.go_on([this] { end(finish()); });
    } else if (const Status s = take(); !s.ok()) {
      end(s);
    } else {
      StartRead(&request_);
    }
  }
  void OnDone() override {
    call_.context.streams.remove(this);
    delete this;
  }
  void wind_up() override { call_.rpc.TryCancel(); }
  void look_at_clock(std::chrono::steady_clock::time_point) override {
    if (double(now_ns() - last_message_) * 1e-9 > call_.context.settings.idle_stream_s) call_.rpc.TryCancel();
  }

 private:
  static std::int64_t now_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

  void end(const Status& s) {
    discard();
    Finish(call_.end(s));
  }

  /// Whatever was not taken over by the service.
  void discard() {
    if (file_ != nullptr) std::fclose(file_);
    if (!path_.empty()) ::unlink(path_.c_str());
    file_ = nullptr;
    path_.clear();
  }

  Status take() {
    if (file_ == nullptr) {
      map_ = request_.map();
      if (!is_map_name(map_)) return make_error(ErrorCode::kInvalidArgument, "that is no name of a map");
      MAPCODEC_TRY(call_.admit(Right::admin, map_, CallKind::stream));
      path_ = call_.context.service.settings().folder + "/.upload-XXXXXX";
      const int fd = ::mkstemp(path_.data());
      if (fd >= 0) file_ = ::fdopen(fd, "wb");
      if (file_ == nullptr) {
        path_.clear();
        return make_error(ErrorCode::kCannotWrite, "no file can be made beside the maps");
      }
    }
    MAPCODEC_TRY(call_.charge_in(request_.data().size()));
    const std::string& data = request_.data();
    if (std::fwrite(data.data(), 1, data.size(), file_) != data.size()) return cannot_write();
    return {};
  }

  Status finish() {
    if (call_.rpc.IsCancelled()) return make_error(ErrorCode::kCancelled, "the client gave up");
    if (file_ == nullptr) return make_error(ErrorCode::kMalformed, "nothing was sent");
    const bool written = std::fflush(file_) == 0 && ::fsync(::fileno(file_)) == 0;
    if (!written) return cannot_write();
    MAPCODEC_TRY(call_.context.service.adopt(map_, path_, call_.principal()));
    path_.clear();
    MAPCODEC_ASSIGN(const MapViewPtr view, call_.context.service.view(map_));
    reply_.set_revision(view->archive->revision());
    return {};
  }

  static Error cannot_write() {
    return make_error(ErrorCode::kCannotWrite,
                      "the archive cannot be stored: no space is left, or the disk fails");
  }

  Call call_;
  v1::RevisionReply& reply_;
  v1::UploadRequest request_;
  std::string map_, path_;
  std::FILE* file_ = nullptr;
  std::atomic<std::int64_t> last_message_;
};

}  // namespace

grpc::ServerWriteReactor<v1::ReadArchiveReply>* begin_read_archive(CallContext& context,
                                                                   CallbackServerContext* grpc,
                                                                   const v1::ReadArchiveRequest& request) {
  auto* stream = new ReadArchiveStream(context, grpc, request);
  stream->begin(Right::read, request.map(), request.ByteSizeLong());
  return stream;
}

grpc::ServerReadReactor<v1::UploadRequest>* begin_upload(CallContext& context, CallbackServerContext* grpc,
                                                         v1::RevisionReply* reply) {
  return new UploadStream(context, grpc, reply);
}

}  // namespace mapcodec::daemon
