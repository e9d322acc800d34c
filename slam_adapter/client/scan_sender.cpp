// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/scan_sender.hpp"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

#include "maps/service/wire.hpp"
#include "slam_adapter/client/connection.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kPiecePoints = std::size_t{1} << 17;

bool may_pass(ErrorCode code) {
  return code == ErrorCode::kUnreachable || code == ErrorCode::kBusy || code == ErrorCode::kCannotWrite;
}

PointCloud finite_only(PointCloud cloud) {
  std::vector<std::uint32_t> kept;
  for (std::uint32_t i = 0; i < cloud.size(); ++i) {
    if (is_finite(cloud.xyz[i])) kept.push_back(i);
  }
  return kept.size() == cloud.size() ? std::move(cloud) : cloud.gather(kept);
}

}  // namespace

struct ScanSender::Impl {
  using Stream = grpc::ClientReaderWriter<v1::InsertRequest, v1::InsertReply>;

  Impl(const MapClient& c, const SenderSettings& s) : connection(c.connection()), settings(s) {}

  struct Piece {
    v1::InsertRequest message;
    std::uint64_t sequence = 0, points = 0;
  };

  Status connect_once();
  Status connect();
  void disconnect();
  void read_replies();
  Status send(Piece piece);
  Status resend();
  /// Waits until `ready`, connecting again as often as needed. Called under the lock.
  Status wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& ready);
  void acknowledge(std::uint64_t sequence);
  Status why_ended();

  std::shared_ptr<MapClient::Connection> connection;
  const SenderSettings settings;
  std::unique_ptr<grpc::ClientContext> context;
  std::unique_ptr<Stream> stream;
  std::thread reader;

  std::mutex mutex;
  std::condition_variable changed;
  std::deque<Piece> pending;
  std::uint64_t pending_points = 0, next = 1, acknowledged = 0, revision = 0, reconnects = 0;
  bool ended = false;  // the reader has come to the stream's end
  Status failed;       // for good
};

void ScanSender::Impl::acknowledge(std::uint64_t sequence) {
  acknowledged = std::max(acknowledged, sequence);
  while (!pending.empty() && pending.front().sequence <= sequence) {
    pending_points -= pending.front().points;
    pending.pop_front();
  }
}

void ScanSender::Impl::read_replies() {
  v1::InsertReply reply;
  while (stream->Read(&reply)) {
    const std::lock_guard lock(mutex);
    acknowledge(reply.sequence());
    revision = std::max(revision, reply.revision());
    changed.notify_all();
  }
  const std::lock_guard lock(mutex);
  ended = true;
  changed.notify_all();
}

/// Opens a stream and learns what the service has of this writer.
Status ScanSender::Impl::connect_once() {
  context = std::make_unique<grpc::ClientContext>();
  connection->prepare(*context, 0);
  stream = connection->stub->Insert(context.get());
  v1::InsertRequest open;
  open.mutable_open()->set_map(connection->url.map);
  open.mutable_open()->set_writer(settings.writer);
  if (!settings.writer.empty()) open.mutable_open()->set_acknowledged(acknowledged);
  v1::InsertReply reply;
  if (!stream->Write(open) || !stream->Read(&reply)) {
    const grpc::Status s = stream->Finish();
    stream = nullptr;
    return s.ok() ? Status(make_error(ErrorCode::kUnreachable, "the server ended the stream"))
                  : status_of(*context, s, connection->url);
  }
  if (!settings.writer.empty()) acknowledge(reply.sequence());
  if (pending.empty() && !settings.writer.empty()) next = std::max(next, reply.sequence() + 1);
  ended = false;
  reader = std::thread([this] { read_replies(); });
  return resend();
}

Status ScanSender::Impl::resend() {
  for (const Piece& p : pending) {
    if (!stream->Write(p.message)) break;  // the reader will find out why
  }
  return {};
}

Status ScanSender::Impl::connect() {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::duration<double>(settings.retry_s);
  for (auto pause = std::chrono::milliseconds(20);;
       pause = std::min(2 * pause, std::chrono::milliseconds(1000))) {
    const Status s = connect_once();
    if (s.ok() || !may_pass(s.error().code) || std::chrono::steady_clock::now() > give_up) return s;
    std::this_thread::sleep_for(pause);
  }
}

void ScanSender::Impl::disconnect() {
  if (context) context->TryCancel();
  if (reader.joinable()) reader.join();
  stream = nullptr;
}

/// The stream has ended although there is something to send.
Status ScanSender::Impl::why_ended() {
  if (reader.joinable()) reader.join();
  stream->WritesDone();
  const grpc::Status s = stream->Finish();
  stream = nullptr;
  return s.ok() ? Status(make_error(ErrorCode::kUnreachable, "the server ended the stream"))
                : status_of(*context, s, connection->url);
}

Status ScanSender::Impl::wait(std::unique_lock<std::mutex>& lock, const std::function<bool()>& ready) {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::duration<double>(settings.retry_s);
  while (!ready()) {
    changed.wait(lock, [&] { return ended || ready(); });
    if (!ended || ready()) continue;
    lock.unlock();
    Status s = why_ended();
    const bool again = may_pass(s.error().code) && std::chrono::steady_clock::now() < give_up;
    if (again) {
      if (s.error().code != ErrorCode::kUnreachable)
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
      s = connect();
      ++reconnects;
    }
    lock.lock();
    if (!s.ok()) {
      failed = s;
      return s;
    }
  }
  return {};
}

Status ScanSender::Impl::send(Piece piece) {
  std::unique_lock lock(mutex);
  MAPCODEC_TRY(failed);
  MAPCODEC_TRY(wait(
      lock, [&] { return pending_points == 0 || pending_points + piece.points <= settings.window_points; }));
  piece.sequence = next++;
  piece.message.mutable_scan()->set_sequence(piece.sequence);
  pending_points += piece.points;
  pending.push_back(std::move(piece));
  const v1::InsertRequest& message = pending.back().message;
  // Only this thread removes from the end, and what is acknowledged was written.
  lock.unlock();
  (void)stream->Write(message);
  return {};
}

ScanSender::ScanSender(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ScanSender::~ScanSender() {
  impl_->disconnect();
}

Result<std::unique_ptr<ScanSender>> ScanSender::open(const MapClient& client,
                                                     const SenderSettings& settings) {
  auto impl = std::make_unique<Impl>(client, settings);
  if (const Status s = impl->connect(); !s.ok()) return s.error();
  return std::unique_ptr<ScanSender>(new ScanSender(std::move(impl)));
}

Status ScanSender::send(Scan scan) {
  const PointCloud cloud = finite_only(std::move(scan.points));
  const bool f64 = cloud.coordinates.kind != CoordinateFormat::Kind::f32;
  std::size_t begin = 0;
  do {
    const std::size_t end = std::min(cloud.size(), begin + kPiecePoints);
    Impl::Piece piece;
    piece.points = end - begin;
    v1::InsertScan& message = *piece.message.mutable_scan();
    message.set_submap(scan.submap);
    const auto write_pose = [](const std::optional<PoseChange>& p, v1::Pose& out) {
      wire::write(p->translation_m, p->rotation_xyzw, out);
    };
    if (scan.T_submap_scan) write_pose(scan.T_submap_scan, *message.mutable_t_submap_scan());
    if (scan.T_map_submap) write_pose(scan.T_map_submap, *message.mutable_t_map_submap());
    wire::write(cloud, begin, end, f64, *message.mutable_points());
    MAPCODEC_TRY(impl_->send(std::move(piece)));
    begin = end;
  } while (begin < cloud.size());
  return {};
}

Result<std::uint64_t> ScanSender::finish() {
  Impl& i = *impl_;
  std::unique_lock lock(i.mutex);
  MAPCODEC_TRY(i.failed);
  MAPCODEC_TRY(i.wait(lock, [&] { return i.pending.empty(); }));
  return i.revision;
}

std::uint64_t ScanSender::acknowledged() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->acknowledged;
}
std::uint64_t ScanSender::sent() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->next - 1;
}
std::uint64_t ScanSender::reconnects() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->reconnects;
}

}  // namespace mapcodec
