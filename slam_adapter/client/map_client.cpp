// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/map_client.hpp"

#include <fstream>

#include "maps/service/wire.hpp"
#include "slam_adapter/client/connection.hpp"

namespace mapcodec {
namespace {

using Stub = v1::MapService::Stub;

/// One call with one answer.
template <class Request, class Reply>
Status call(const MapClient::Connection& c, double timeout_s,
            grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Reply*),
            const Request& request, Reply& reply) {
  grpc::ClientContext context;
  c.prepare(context, timeout_s);
  const grpc::Status s = (c.stub.get()->*method)(&context, request, &reply);
  return status_of(context, s, c.url);
}

template <class Request>
Result<std::uint64_t> change(const MapClient::Connection& c,
                             grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                          v1::RevisionReply*),
                             Request request) {
  request.set_map(c.url.map);
  v1::RevisionReply reply;
  MAPCODEC_TRY(call(c, c.settings.job_timeout_s, method, request, reply));
  return reply.revision();
}

}  // namespace

Status MapClient::create(const NewMap& map, std::uint64_t keep_last) const {
  v1::CreateMapRequest r;
  r.set_map(url().map);
  r.set_promise(map.promise == PromiseKind::lossless    ? v1::CreateMapRequest::LOSSLESS
                : map.promise == PromiseKind::max_error ? v1::CreateMapRequest::MAX_ERROR
                                                        : v1::CreateMapRequest::RMS);
  r.set_promise_m(map.promise_m);
  r.set_color_error(map.color_error);
  r.set_tile_size(map.tile_size_m);
  r.set_keep_last(keep_last);
  for (const ChannelInfo& c : map.channels) wire::write(c, *r.add_channels());
  const bool f64 = map.sample.coordinates.kind != CoordinateFormat::Kind::f32;
  if (!map.sample.empty()) wire::write(map.sample, 0, map.sample.size(), f64, *r.mutable_sample());
  v1::CreateMapReply reply;
  return call(*connection_, connection_->settings.job_timeout_s, &Stub::CreateMap, r, reply);
}

Result<std::vector<MapEntry>> MapClient::list() const {
  v1::ListMapsReply reply;
  MAPCODEC_TRY(call(*connection_, connection_->settings.timeout_s, &Stub::ListMaps, {}, reply));
  std::vector<MapEntry> maps;
  for (const v1::MapEntry& m : reply.maps())
    maps.push_back({m.map(), m.revision(), m.tiles(), m.points(), m.bytes(), m.timestamp(), m.fault()});
  return maps;
}

Status MapClient::remove() const {
  v1::DeleteMapRequest r;
  r.set_map(url().map);
  v1::DeleteMapReply reply;
  return call(*connection_, connection_->settings.job_timeout_s, &Stub::DeleteMap, r, reply);
}

Result<MapStats> MapClient::stats() const {
  v1::StatsRequest r;
  r.set_map(url().map);
  v1::StatsReply reply;
  MAPCODEC_TRY(call(*connection_, connection_->settings.timeout_s, &Stub::Stats, r, reply));
  const v1::MapFigures& m = reply.map();
  return MapStats{m.revision(),     m.tiles(),         m.points(),  m.live_bytes(), m.file_bytes(),
                  m.queued_scans(), m.queued_points(), m.editing(), m.compacting()};
}

Result<ServiceStats> MapClient::service_stats() const {
  v1::StatsReply reply;
  MAPCODEC_TRY(call(*connection_, connection_->settings.timeout_s, &Stub::Stats, v1::StatsRequest(), reply));
  ServiceStats s;
  s.maps = reply.maps();
  s.editors = reply.editors();
  s.queued_scans = reply.queued_scans();
  s.queued_points = reply.queued_points();
  s.queue_limit_points = reply.queue_limit_points();
  s.cache_bytes = reply.cache_bytes();
  s.cache_limit_bytes = reply.cache_limit_bytes();
  s.cache_hits = reply.cache_hits();
  s.cache_misses = reply.cache_misses();
  s.watchers = reply.watchers();
  return s;
}

Result<std::uint64_t> MapClient::set_poses(const std::vector<MapService::NamedPose>& poses) const {
  v1::SetPosesRequest r;
  for (const auto& p : poses) {
    v1::SetPosesRequest::SubmapPose& pose = *r.add_poses();
    pose.set_submap(p.submap);
    wire::write(p.pose.translation_m, p.pose.rotation_xyzw, *pose.mutable_t_map_submap());
  }
  return change(*connection_, &Stub::SetPoses, std::move(r));
}

Result<std::uint64_t> MapClient::erase(const std::optional<Erasure>& e,
                                       const std::optional<std::string>& submap) const {
  v1::EraseRequest r;
  if (submap) r.set_submap(*submap);
  if (e && e->box) wire::write(*e->box, *r.mutable_box());
  if (e && e->sphere) {
    wire::write(e->sphere->centre, *r.mutable_sphere()->mutable_centre());
    r.mutable_sphere()->set_radius(e->sphere->radius_m);
  }
  if (e && e->values) {
    r.set_channel(e->values->channel);
    r.set_least(e->values->least);
    r.set_most(e->values->most);
  }
  if (e) r.set_inverse(e->inverse);
  return change(*connection_, &Stub::Erase, std::move(r));
}

Result<std::uint64_t> MapClient::snapshot(const std::string& name, bool remove) const {
  v1::SnapshotRequest r;
  r.set_name(name);
  r.set_remove(remove);
  return change(*connection_, &Stub::Snapshot, std::move(r));
}

Result<std::uint64_t> MapClient::rollback(const std::string& revision) const {
  v1::RollbackRequest r;
  r.set_revision(revision);
  return change(*connection_, &Stub::Rollback, std::move(r));
}

Result<CompactReport> MapClient::compact(std::uint64_t keep_last) const {
  v1::CompactRequest r;
  r.set_map(url().map);
  r.set_keep_last(keep_last);
  v1::CompactReply reply;
  MAPCODEC_TRY(call(*connection_, connection_->settings.job_timeout_s, &Stub::Compact, r, reply));
  CompactReport report;
  report.bytes_before = reply.bytes_before();
  report.bytes_after = reply.bytes_after();
  report.revisions_before = reply.revisions_before();
  report.revisions_after = reply.revisions_after();
  report.folded_tiles = reply.folded_tiles();
  report.hashes = true;
  return report;
}

Result<std::uint64_t> MapClient::upload(const std::string& path) const {
  constexpr std::size_t kPart = std::size_t{1} << 20;
  std::ifstream in(path, std::ios::binary);
  if (!in) return make_error(ErrorCode::kUnreadable, path + ": cannot be read");
  grpc::ClientContext context;
  connection_->prepare(context, connection_->settings.job_timeout_s);
  v1::RevisionReply reply;
  const auto writer = connection_->stub->Upload(&context, &reply);
  v1::UploadRequest part;
  part.set_map(url().map);
  std::string data(kPart, '\0');
  bool going = true;
  do {
    in.read(data.data(), static_cast<std::streamsize>(data.size()));
    part.set_data(data.data(), static_cast<std::size_t>(in.gcount()));
    going = writer->Write(part);
    part.clear_map();
  } while (going && in);
  writer->WritesDone();
  MAPCODEC_TRY(status_of(context, writer->Finish(), url()));
  return reply.revision();
}

}  // namespace mapcodec
