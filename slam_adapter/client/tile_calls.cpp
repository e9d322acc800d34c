// SPDX-License-Identifier: GPL-3.0-or-later
// The client's streams of tiles and of changes.
#include <thread>

#include "mapcodec/base/crc32c.hpp"
#include "maps/service/wire.hpp"
#include "slam_adapter/client/connection.hpp"

namespace mapcodec {
namespace {

Result<RemoteFacts> facts_of(const v1::MapFacts& facts) {
  RemoteFacts f;
  f.revision = facts.revision();
  f.timestamp_s = facts.timestamp();
  MAPCODEC_ASSIGN(f.info, wire::read(facts));
  return f;
}

v1::GetTilesRequest message_of(const TileRequest& r, const std::string& map) {
  v1::GetTilesRequest m;
  m.set_map(map);
  m.set_revision(r.revision);
  for (const auto& k : r.selection.keys) wire::write(k.submap, k.key, *m.add_keys());
  if (r.selection.box) wire::write(*r.selection.box, *m.mutable_box());
  if (r.selection.sphere) {
    wire::write(r.selection.sphere->centre, *m.mutable_sphere()->mutable_centre());
    m.mutable_sphere()->set_radius(r.selection.sphere->radius_m);
  }
  for (const ContentHash& h : r.have) m.mutable_if_none_match()->append(wire::bytes_of(h));
  for (const ContentHash& h : r.have_segments) m.mutable_have_segments()->append(wire::bytes_of(h));
  if (r.coarse_level) m.set_coarse_level(*r.coarse_level + 1);
  m.set_max_bytes(r.max_bytes);
  m.set_without_bytes(r.without_bytes);
  return m;
}

/// Puts tiles together from messages. The server is not trusted either: sizes and checksums are checked.
class TileAssembly {
 public:
  TileAssembly(const TileRequest& request, const std::function<Status(RemoteTile&&)>& sink)
      : without_bytes_(request.without_bytes), sink_(sink) {}

  Status take(const v1::GetTilesReply& reply) {
    if (reply.has_tile()) {
      MAPCODEC_TRY(end_tile());
      MAPCODEC_TRY(begin_tile(reply.tile()));
    }
    if (reply.data().empty()) return {};
    if (!open_) return make_error(ErrorCode::kMalformed, "the server sent bytes of no tile");
    return add(reply.data());
  }
  Status end_tile() {
    if (!open_) return {};
    open_ = false;
    if (left() != 0) return make_error(ErrorCode::kTruncated, "the server did not send a whole tile");
    for (std::size_t i = 0; i < tile_.segments.size(); ++i) {
      const Bytes& bytes = tile_.segments[i];
      if (bytes.empty() || tile_.coarse) continue;
      if (crc32c(bytes) != tile_.record.segments[i].crc)
        return make_error(ErrorCode::kChecksumMismatch,
                          "tile " + tile_name(tile_.record) + " was changed on its way");
    }
    return sink_(std::move(tile_));
  }

 private:
  Status begin_tile(const v1::Tile& t) {
    tile_ = {};
    open_ = true;
    at_ = 0;
    MAPCODEC_ASSIGN(const TileSelection::Key key, wire::read(t.key()));
    tile_.record.key = key.key;
    tile_.record.submap = key.submap;
    tile_.record.codec = static_cast<std::uint8_t>(t.codec());
    tile_.record.points = t.points();
    if (t.has_bounds()) tile_.record.bounds = wire::read(t.bounds());
    tile_.record.errors = wire::read(t.errors());
    MAPCODEC_ASSIGN(tile_.hash, wire::read_hash(t.hash()));
    tile_.not_modified = t.not_modified();
    if (t.coarse_level() > 0) tile_.coarse = t.coarse_level() - 1;
    return take_segments(t);
  }

  Status take_segments(const v1::Tile& t) {
    const auto malformed = [](const char* what) { return make_error(ErrorCode::kMalformed, what); };
    const int count = t.segment_bytes_size();
    if (!tile_.coarse && t.segment_crc_size() != count) return malformed("segments without checksums");
    if (t.segment_sent_size() != 0 && t.segment_sent_size() != count)
      return malformed("segments do not match");
    for (int i = 0; i < count; ++i) {
      if (t.segment_bytes(i) == 0 || t.segment_bytes(i) > kMaxSegmentBytes)
        return malformed("a segment's size");
      tile_.record.segments.push_back({0, t.segment_bytes(i), tile_.coarse ? 0 : t.segment_crc(i)});
      const bool nothing = tile_.not_modified || without_bytes_;
      tile_.sent.push_back(!nothing && (t.segment_sent_size() == 0 || t.segment_sent(i)));
    }
    tile_.segments.resize(tile_.record.segments.size());
    const std::string& hashes = t.segment_hashes();
    for (std::size_t i = 0; i + 16 <= hashes.size(); i += 16) {
      MAPCODEC_ASSIGN(const ContentHash h, wire::read_hash(std::string_view(hashes).substr(i, 16)));
      tile_.record.hashes.push_back(h);
    }
    return {};
  }

  [[nodiscard]] std::uint64_t left() const {
    std::uint64_t bytes = 0;
    for (std::size_t i = at_; i < tile_.segments.size(); ++i) {
      if (tile_.sent[i]) bytes += tile_.record.segments[i].length - tile_.segments[i].size();
    }
    return bytes;
  }

  Status add(std::string_view data) {
    while (!data.empty()) {
      while (at_ < tile_.segments.size() &&
             (!tile_.sent[at_] || tile_.segments[at_].size() == tile_.record.segments[at_].length))
        ++at_;
      if (at_ == tile_.segments.size())
        return make_error(ErrorCode::kMalformed, "the server sent more bytes than the tile has");
      Bytes& bytes = tile_.segments[at_];
      const std::size_t size =
          std::min<std::size_t>(data.size(), tile_.record.segments[at_].length - bytes.size());
      bytes.insert(bytes.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(size));
      data.remove_prefix(size);
    }
    return {};
  }

  const bool without_bytes_;
  const std::function<Status(RemoteTile&&)>& sink_;
  RemoteTile tile_;
  std::size_t at_ = 0;
  bool open_ = false;
};

Result<TileChange> change_of(const v1::TileChange& c) {
  TileChange change;
  change.kind = static_cast<ChangeKind>(c.kind());
  MAPCODEC_ASSIGN(const TileSelection::Key key, wire::read(c.key()));
  change.submap = key.submap;
  change.key = key.key;
  change.points_before = c.points_before();
  change.points_after = c.points();
  change.bytes_before = c.bytes_before();
  change.bytes_after = c.bytes();
  if (change.kind != ChangeKind::removed) {
    MAPCODEC_ASSIGN(change.hash, wire::read_hash(c.hash()));
  }
  return change;
}

/// Cancels a call when somebody says so.
class StopWatch {
 public:
  StopWatch(grpc::ClientContext& context, const std::atomic<bool>* stop) {
    if (stop == nullptr) return;
    thread_ = std::thread([this, &context, stop] {
      while (!done_ && !*stop) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (!done_) context.TryCancel();
    });
  }
  ~StopWatch() {
    done_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace

Status MapClient::tiles(const TileRequest& request, RemoteFacts* facts,
                        const std::function<Status(RemoteTile&&)>& sink) const {
  grpc::ClientContext context;
  connection_->prepare(context, connection_->settings.job_timeout_s);
  const auto reader = connection_->stub->GetTiles(&context, message_of(request, url().map));
  v1::GetTilesReply reply;
  TileAssembly assembly(request, sink);
  Status mine;
  while (mine.ok() && reader->Read(&reply)) {
    if (reply.has_facts() && facts != nullptr) {
      auto read = facts_of(reply.facts());
      if (!read.ok()) mine = read.error();
      if (read.ok()) *facts = std::move(read).value();
    }
    if (mine.ok()) mine = assembly.take(reply);
  }
  if (!mine.ok()) context.TryCancel();
  const grpc::Status s = reader->Finish();
  if (!mine.ok()) return mine;
  MAPCODEC_TRY(status_of(context, s, url()));
  return assembly.end_tile();
}

Status MapClient::watch(std::uint64_t since, bool once, const std::atomic<bool>* stop,
                        const std::function<Result<bool>(RemoteChanges&&)>& sink) const {
  grpc::ClientContext context;
  connection_->prepare(context, once ? connection_->settings.job_timeout_s : 0);
  v1::WatchRequest request;
  request.set_map(url().map);
  request.set_since(since);
  request.set_once(once);
  const auto reader = connection_->stub->Watch(&context, request);
  const StopWatch watch(context, stop);
  v1::WatchReply reply;
  RemoteChanges step;
  Result<bool> mine(true);
  while (mine.ok() && *mine && reader->Read(&reply)) {
    step.reset = reply.reset();
    for (const v1::TileChange& c : reply.changes()) {
      auto change = change_of(c);
      if (!change.ok()) mine = change.error();
      if (change.ok()) step.changes.push_back(std::move(change).value());
    }
    if (!reply.complete() || !mine.ok()) continue;
    auto facts = facts_of(reply.facts());
    if (!facts.ok()) mine = facts.error();
    if (!facts.ok()) continue;
    step.facts = std::move(facts).value();
    mine = sink(std::exchange(step, {}));
  }
  const bool ended = !mine.ok() || !*mine;
  if (ended) context.TryCancel();
  const grpc::Status s = reader->Finish();
  if (!mine.ok()) return mine.error();
  if (ended) return {};
  return status_of(context, s, url());
}

}  // namespace mapcodec
