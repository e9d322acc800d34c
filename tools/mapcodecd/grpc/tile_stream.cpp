// SPDX-License-Identifier: GPL-3.0-or-later
#include <unordered_set>

#include "maps/service/wire.hpp"
#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::size_t kPartBytes = std::size_t{1} << 20;
// A coarse form that takes more of the tile's bytes than this is not worth sending first.
constexpr double kWorthwhile = 0.6;

struct HashHash {
  std::size_t operator()(const ContentHash& h) const {
    std::size_t v;
    std::memcpy(&v, h.bytes.data(), sizeof v);
    return v;
  }
};

using HashSet = std::unordered_set<ContentHash, HashHash>;

Result<HashSet> hashes_of(std::string_view bytes) {
  if (bytes.size() % 16 != 0) return make_error(ErrorCode::kMalformed, "hashes have 16 bytes each");
  HashSet hashes;
  for (std::size_t i = 0; i < bytes.size(); i += 16) {
    MAPCODEC_ASSIGN(const ContentHash h, wire::read_hash(bytes.substr(i, 16)));
    hashes.insert(h);
  }
  return hashes;
}

Result<TileSelection> selection_of(const v1::GetTilesRequest& r) {
  TileSelection s;
  for (const v1::TileKey& k : r.keys()) {
    MAPCODEC_ASSIGN(const TileSelection::Key key, wire::read(k));
    s.keys.push_back(key);
  }
  if (r.has_box()) s.box = wire::read(r.box());
  if (r.has_sphere()) s.sphere = {wire::read(r.sphere().centre()), r.sphere().radius()};
  if (r.has_pose()) {
    if (r.has_sphere())
      return make_error(ErrorCode::kInvalidArgument, "ask by a sphere or by a pose, not both");
    MAPCODEC_ASSIGN(const PoseChange pose, wire::read(r.pose()));
    s.sphere = {pose.translation_m, r.radius()};
  }
  return s;
}

class TileStream final : public ReplyStream<v1::GetTilesReply> {
 public:
  TileStream(CallContext& context, CallbackServerContext* grpc, const v1::GetTilesRequest& request)
      : ReplyStream(context, grpc, "GetTiles"), request_(request) {}

 private:
  using Segments = std::vector<std::shared_ptr<const Bytes>>;

  Result<bool> next(v1::GetTilesReply& reply) override {
    if (view_ == nullptr) return begin_reply(reply);
    if (part_ == parts_.size() && !begin_tile(reply)) {
      if (!failed_.ok()) return failed_.error();
      return false;
    }
    if (part_ < parts_.size()) add_data(reply);
    return true;
  }

  Result<bool> begin_reply(v1::GetTilesReply& reply) {
    MAPCODEC_ASSIGN(view_, call().context.service.view(request_.map(), request_.revision()));
    MAPCODEC_ASSIGN(const TileSelection selection, selection_of(request_));
    MAPCODEC_ASSIGN(tiles_, MapService::select(*view_, selection));
    MAPCODEC_ASSIGN(have_, hashes_of(request_.if_none_match()));
    MAPCODEC_ASSIGN(have_segments_, hashes_of(request_.have_segments()));
    coarse_ = request_.coarse_level() > 0 && !request_.without_bytes();
    set_light(!coarse_);
    wire::write(*view_->archive, *reply.mutable_facts());
    reply.set_tiles_selected(tiles_.size());
    return true;
  }

  /// The next tile that is sent in this pass. @return false: none is left, or `failed_`.
  bool begin_tile(v1::GetTilesReply& reply) {
    for (;;) {
      if (at_ == tiles_.size()) {
        if (!coarse_) return false;
        coarse_ = false;
        set_light(true);
        at_ = 0;
        continue;
      }
      const Result<bool> begun = describe(tiles_[at_++], reply);
      if (!begun.ok()) failed_ = begun.error();
      if (!begun.ok() || *begun) return begun.ok();
      if (ended_) return false;
    }
  }

  /// @return false: not in this pass.
  Result<bool> describe(std::size_t index, v1::GetTilesReply& reply) {
    const TileRecord& record = view_->archive->tiles()[index];
    MAPCODEC_ASSIGN(const ContentHash hash, view_->archive->hash(record));
    const bool known = have_.contains(hash);
    if (coarse_ && known) return false;
    std::uint64_t size = 0;
    for (const SegmentRef& s : record.segments) size += s.length;
    if (request_.max_bytes() > 0 && !known && sent_ + size > request_.max_bytes()) {
      ended_ = true;
      at_ = tiles_.size();
      coarse_ = false;
      return false;
    }
    Segments segments;
    if (!known && !request_.without_bytes()) {
      MAPCODEC_ASSIGN(segments, call().context.service.segments(*view_, index));
    }
    std::uint64_t leading = 0;
    if (coarse_) {
      const ByteSpan base(*segments.front());
      const unsigned level = request_.coarse_level() - 1;
      MAPCODEC_ASSIGN(leading, call().context.service.coding().bytes_of_level(base, view_->schema, level));
      if (double(leading) > kWorthwhile * double(size)) return false;
    }
    write_head(record, hash, known, leading, *reply.mutable_tile());
    make_parts(segments, leading, reply.tile());
    if (!coarse_ && !known) sent_ += size;
    using Counter = ServiceMetrics::Counter;
    call().context.metrics.add(known ? Counter::tiles_not_modified : Counter::tiles_out);
    return true;
  }

  void write_head(const TileRecord& record, const ContentHash& hash, bool known, std::uint64_t leading,
                  v1::Tile& tile) const {
    wire::write(record.submap, record.key, *tile.mutable_key());
    tile.set_codec(record.codec);
    tile.set_points(record.points);
    if (!record.bounds.empty()) wire::write(record.bounds, *tile.mutable_bounds());
    wire::write(record.errors, *tile.mutable_errors());
    tile.set_hash(wire::bytes_of(hash));
    tile.set_not_modified(known);
    if (leading > 0) {
      tile.add_segment_bytes(static_cast<std::uint32_t>(leading));
      tile.set_coarse_level(request_.coarse_level());
      return;
    }
    for (const SegmentRef& s : record.segments) {
      tile.add_segment_bytes(s.length);
      tile.add_segment_crc(s.crc);
    }
    for (const ContentHash& h : record.hashes) tile.mutable_segment_hashes()->append(wire::bytes_of(h));
    if (have_segments_.empty() || known || record.hashes.empty()) return;
    for (const ContentHash& h : record.hashes) tile.add_segment_sent(!have_segments_.contains(h));
  }

  void make_parts(const Segments& segments, std::uint64_t leading, const v1::Tile& tile) {
    parts_.clear();
    part_ = 0;
    for (std::size_t i = 0; i < segments.size(); ++i) {
      if (leading == 0 && tile.segment_sent_size() > 0 && !tile.segment_sent(static_cast<int>(i))) continue;
      const auto& s = segments[i];
      const std::size_t size = leading > 0 ? leading : s->size();
      for (std::size_t at = 0; at < size; at += kPartBytes)
        parts_.push_back({s, at, std::min(kPartBytes, size - at)});
      if (leading > 0) break;
    }
  }

  /// As much as goes into one message.
  void add_data(v1::GetTilesReply& reply) {
    std::string& data = *reply.mutable_data();
    while (part_ < parts_.size() && data.size() + parts_[part_].size <= kPartBytes) {
      const Part& p = parts_[part_++];
      data.append(reinterpret_cast<const char*>(p.bytes->data()) + p.offset, p.size);
    }
    if (part_ == parts_.size()) parts_.clear(), part_ = 0;
  }

  struct Part {
    std::shared_ptr<const Bytes> bytes;
    std::size_t offset = 0, size = 0;
  };

  const v1::GetTilesRequest request_;
  MapViewPtr view_;
  std::vector<std::size_t> tiles_;
  HashSet have_, have_segments_;
  std::vector<Part> parts_;
  std::size_t part_ = 0, at_ = 0;
  std::uint64_t sent_ = 0;
  bool coarse_ = false, ended_ = false;
  Status failed_;
};

}  // namespace

grpc::ServerWriteReactor<v1::GetTilesReply>* begin_get_tiles(CallContext& context,
                                                             CallbackServerContext* grpc,
                                                             const v1::GetTilesRequest& request) {
  auto* stream = new TileStream(context, grpc, request);
  stream->begin(Right::read, request.map(), request.ByteSizeLong());
  return stream;
}

}  // namespace mapcodec::daemon
