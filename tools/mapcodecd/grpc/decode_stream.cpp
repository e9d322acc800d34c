// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/wire.hpp"
#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::size_t kPointsAtOnce = 65536;
// A tile that would take more is not decoded for somebody else.
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 30;

class DecodeStream final : public ReplyStream<v1::DecodeReply> {
 public:
  DecodeStream(CallContext& context, CallbackServerContext* grpc, const v1::DecodeRequest& request)
      : ReplyStream(context, grpc, "Decode"), request_(request) {}

 private:
  Result<bool> next(v1::DecodeReply& reply) override {
    if (view_ == nullptr) {
      MAPCODEC_TRY(open());
      reply.set_revision(view_->archive->revision());
      return true;
    }
    while (sent_ == cloud_.size()) {
      if (at_ == tiles_.size() || call().rpc.IsCancelled()) return false;
      MAPCODEC_TRY(decode(tiles_[at_++]));
    }
    const std::size_t end = std::min(cloud_.size(), sent_ + kPointsAtOnce);
    reply.set_revision(view_->archive->revision());
    wire::write(cloud_, sent_, end, request_.f64(), *reply.mutable_points());
    sent_ = end;
    return true;
  }

  Status open() {
    MAPCODEC_ASSIGN(view_, call().context.service.view(request_.map(), request_.revision()));
    TileSelection selection;
    if (request_.has_box()) selection.box = box_ = wire::read(request_.box());
    if (request_.has_sphere()) {
      sphere_ = {wire::read(request_.sphere().centre()), request_.sphere().radius()};
      selection.sphere = sphere_;
    }
    if (request_.has_origin()) origin_ = wire::read(request_.origin());
    if (!is_finite(origin_)) return make_error(ErrorCode::kInvalidArgument, "the origin is not finite");
    MAPCODEC_ASSIGN(tiles_, MapService::select(*view_, selection));
    return {};
  }

  Status decode(std::size_t index) {
    MAPCODEC_ASSIGN(const auto segments, call().context.service.segments(*view_, index));
    std::vector<ByteSpan> spans;
    for (const auto& s : segments) spans.emplace_back(*s);
    DecodeLimits limits;
    limits.max_bytes = kMostBytes;
    std::optional<unsigned> level;
    if (request_.level() > 0) level = request_.level() - 1;
    MAPCODEC_ASSIGN(PointCloud cloud,
                    call().context.service.coding().decode(spans, view_->schema, level, limits));
    const RigidMotion motion = pose_of(view_->archive->info(), view_->archive->tiles()[index].submap);
    std::vector<std::uint32_t> kept;
    for (std::uint32_t i = 0; i < cloud.size(); ++i) {
      cloud.xyz[i] = motion.apply(cloud.xyz[i]);
      if (wanted(cloud.xyz[i])) kept.push_back(i);
      for (std::size_t d = 0; d < 3 && !request_.f64(); ++d) cloud.xyz[i][d] -= origin_[d];
    }
    keep_channels(cloud);
    cloud_ = kept.size() == cloud.size() ? std::move(cloud) : cloud.gather(kept);
    sent_ = 0;
    return {};
  }

  bool wanted(const Vec3& p) const {
    if (box_ && !box_->contains(p)) return false;
    if (!sphere_) return true;
    double squared = 0;
    for (std::size_t d = 0; d < 3; ++d) squared += (p[d] - sphere_->centre[d]) * (p[d] - sphere_->centre[d]);
    return squared <= sphere_->radius_m * sphere_->radius_m;
  }

  void keep_channels(PointCloud& cloud) const {
    std::erase_if(cloud.channels, [&](const Channel& c) {
      for (const std::string& name : request_.channels()) {
        if (name == "*" || name == c.info.name) return false;
      }
      return true;
    });
  }

  const v1::DecodeRequest request_;
  MapViewPtr view_;
  std::optional<Box> box_;
  std::optional<TileSelection::Sphere> sphere_;
  Vec3 origin_{0, 0, 0};
  std::vector<std::size_t> tiles_;
  PointCloud cloud_;
  std::size_t at_ = 0, sent_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::DecodeReply>* begin_decode(CallContext& context, CallbackServerContext* grpc,
                                                        const v1::DecodeRequest& request) {
  auto* stream = new DecodeStream(context, grpc, request);
  stream->begin(Right::read, request.map(), request.ByteSizeLong());
  return stream;
}

}  // namespace mapcodec::daemon
