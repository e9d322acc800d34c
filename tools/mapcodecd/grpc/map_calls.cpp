// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/grpc/map_calls.hpp"

#include "maps/service/wire.hpp"
#include "tools/version.hpp"

namespace mapcodec::daemon {
namespace {

constexpr std::uint64_t kMostSamplePoints = std::uint64_t{1} << 21;

Result<NewMap> new_map(const v1::CreateMapRequest& r) {
  NewMap map;
  constexpr PromiseKind kKinds[] = {PromiseKind::rms, PromiseKind::max_error, PromiseKind::lossless};
  if (r.promise() < 0 || r.promise() > 2) return make_error(ErrorCode::kUnsupported, "no such promise");
  map.promise = kKinds[r.promise()];
  map.promise_m = r.promise_m();
  if (r.has_color_error()) map.color_error = r.color_error();
  map.tile_size_m = r.tile_size();
  for (const v1::Channel& c : r.channels()) {
    MAPCODEC_ASSIGN(ChannelInfo info, wire::read(c));
    map.channels.push_back(std::move(info));
  }
  MAPCODEC_ASSIGN(map.sample, wire::read(r.sample(), kMostSamplePoints));
  for (std::size_t i = 0; i < map.sample.size(); ++i) {
    if (!is_finite(map.sample.xyz[i]))
      return make_error(ErrorCode::kInvalidArgument, "point " + std::to_string(i) + " is not finite");
  }
  return map;
}

Result<std::optional<Erasure>> erasure_of(const v1::EraseRequest& r) {
  Erasure e;
  if (r.has_box()) e.box = wire::read(r.box());
  if (r.has_sphere()) e.sphere = {wire::read(r.sphere().centre()), r.sphere().radius()};
  if (!r.channel().empty()) e.values = {r.channel(), r.least(), r.most()};
  e.inverse = r.inverse();
  if (!e.box && !e.sphere && !e.values) {
    if (e.inverse) return make_error(ErrorCode::kInvalidArgument, "nothing is named that should stay");
    return std::optional<Erasure>();
  }
  MAPCODEC_TRY(read_erasure(write_erasure(e)));  // NaN and the like
  return std::optional<Erasure>(std::move(e));
}

Status set(Result<std::uint64_t> revision, v1::RevisionReply& reply) {
  if (!revision.ok()) return revision.error();
  reply.set_revision(*revision);
  return {};
}

}  // namespace

MapCalls::Unary* MapCalls::CreateMap(Context* c, const v1::CreateMapRequest* r, v1::CreateMapReply* reply) {
  return answer(context_, c, "CreateMap", Right::admin, r->map(), r->ByteSizeLong(),
                [r, reply](Call& call) -> Status {
                  MAPCODEC_ASSIGN(const NewMap map, new_map(*r));
                  Retention retention;
                  if (r->keep_last() > 0) retention.keep_last = r->keep_last();
                  MAPCODEC_TRY(call.context.service.create(r->map(), map, retention, call.principal()));
                  reply->set_revision(1);
                  return {};
                });
}

MapCalls::Unary* MapCalls::ListMaps(Context* c, const v1::ListMapsRequest*, v1::ListMapsReply* reply) {
  return answer(context_, c, "ListMaps", Right::read, "", 0, [reply](Call& call) -> Status {
    for (const MapEntry& m : call.context.service.list()) {
      if (!call.context.access.may_read(call.credentials(), m.name)) continue;
      v1::MapEntry& entry = *reply->add_maps();
      entry.set_map(m.name);
      entry.set_revision(m.revision);
      entry.set_timestamp(m.timestamp_s);
      entry.set_tiles(m.tiles);
      entry.set_points(m.points);
      entry.set_bytes(m.bytes);
      entry.set_fault(m.fault);
    }
    return {};
  });
}

MapCalls::Unary* MapCalls::DeleteMap(Context* c, const v1::DeleteMapRequest* r, v1::DeleteMapReply*) {
  return answer(context_, c, "DeleteMap", Right::admin, r->map(), r->ByteSizeLong(),
                [r](Call& call) { return call.context.service.remove(r->map()); });
}

MapCalls::Unary* MapCalls::SetPoses(Context* c, const v1::SetPosesRequest* r, v1::RevisionReply* reply) {
  return answer(context_, c, "SetPoses", Right::write, r->map(), r->ByteSizeLong(),
                [r, reply](Call& call) -> Status {
                  std::vector<MapService::NamedPose> poses;
                  for (const auto& p : r->poses()) {
                    MAPCODEC_ASSIGN(const PoseChange pose, wire::read(p.t_map_submap()));
                    poses.push_back({p.submap(), pose});
                  }
                  return set(call.context.service.set_poses(r->map(), std::move(poses)), *reply);
                });
}

MapCalls::Unary* MapCalls::Erase(Context* c, const v1::EraseRequest* r, v1::RevisionReply* reply) {
  return answer(
      context_, c, "Erase", Right::write, r->map(), r->ByteSizeLong(), [r, reply](Call& call) -> Status {
        MAPCODEC_ASSIGN(std::optional<Erasure> e, erasure_of(*r));
        const std::optional<std::string> submap = r->has_submap() ? std::optional(r->submap()) : std::nullopt;
        return set(call.context.service.erase(r->map(), std::move(e), submap), *reply);
      });
}

MapCalls::Unary* MapCalls::Snapshot(Context* c, const v1::SnapshotRequest* r, v1::RevisionReply* reply) {
  return answer(context_, c, "Snapshot", Right::write, r->map(), r->ByteSizeLong(), [r, reply](Call& call) {
    MapService& service = call.context.service;
    return set(
        r->remove() ? service.remove_snapshot(r->map(), r->name()) : service.snapshot(r->map(), r->name()),
        *reply);
  });
}

MapCalls::Unary* MapCalls::Rollback(Context* c, const v1::RollbackRequest* r, v1::RevisionReply* reply) {
  return answer(context_, c, "Rollback", Right::admin, r->map(), r->ByteSizeLong(), [r, reply](Call& call) {
    return set(call.context.service.rollback(r->map(), r->revision()), *reply);
  });
}

MapCalls::Unary* MapCalls::Compact(Context* c, const v1::CompactRequest* r, v1::CompactReply* reply) {
  return answer(context_, c, "Compact", Right::admin, r->map(), r->ByteSizeLong(),
                [r, reply](Call& call) -> Status {
                  CompactJob job;
                  if (r->keep_last() > 0) job.keep_last = r->keep_last();
                  MAPCODEC_ASSIGN(const CompactReport report, call.context.service.compact(r->map(), job));
                  reply->set_bytes_before(report.bytes_before);
                  reply->set_bytes_after(report.bytes_after);
                  reply->set_revisions_before(report.revisions_before);
                  reply->set_revisions_after(report.revisions_after);
                  reply->set_folded_tiles(report.folded_tiles);
                  return {};
                });
}

MapCalls::Unary* MapCalls::Stats(Context* c, const v1::StatsRequest* r, v1::StatsReply* reply) {
  return answer(context_, c, "Stats", Right::read, r->map(), r->ByteSizeLong(),
                [r, reply](Call& call) -> Status {
                  const ServiceStats s = call.context.service.stats();
                  reply->set_maps(s.maps);
                  reply->set_editors(s.editors);
                  reply->set_queued_scans(s.queued_scans);
                  reply->set_queued_points(s.queued_points);
                  reply->set_queue_limit_points(s.queue_limit_points);
                  reply->set_cache_bytes(s.cache_bytes);
                  reply->set_cache_limit_bytes(s.cache_limit_bytes);
                  reply->set_cache_hits(s.cache_hits);
                  reply->set_cache_misses(s.cache_misses);
                  reply->set_watchers(s.watchers);
                  reply->set_version(kVersion);
                  if (r->map().empty()) return {};
                  MAPCODEC_ASSIGN(const MapStats m, call.context.service.stats(r->map()));
                  v1::MapFigures& figures = *reply->mutable_map();
                  figures.set_revision(m.revision);
                  figures.set_tiles(m.tiles);
                  figures.set_points(m.points);
                  figures.set_live_bytes(m.live_bytes);
                  figures.set_file_bytes(m.file_bytes);
                  figures.set_queued_scans(m.queued_scans);
                  figures.set_queued_points(m.queued_points);
                  figures.set_editing(m.editing);
                  figures.set_compacting(m.compacting);
                  return {};
                });
}

}  // namespace mapcodec::daemon
