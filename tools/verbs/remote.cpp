// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/verbs/remote.hpp"

#include <unistd.h>

#include <filesystem>

#include "slam_adapter/client/remote_store.hpp"
#include "slam_adapter/client/scan_sender.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/map_file.hpp"
#include "slam_adapter/octomap/octree_layer.hpp"
#include "slam_adapter/point_batch.hpp"
#include "tools/verbs/report.hpp"

namespace mapcodec::cli {
namespace {

constexpr std::size_t kSamplePoints = std::size_t{1} << 20;

void say_unkept(const std::string& path, const PointCloud& layout, const MapSchema& schema,
                std::vector<std::string>& warnings) {
  for (const std::string& name : unkept_channels(layout, schema))
    warnings.push_back(path + ": the map does not keep " + name);
}

/// Only what the map keeps goes over the network.
void keep_only(PointCloud& cloud, const PointCloud& layout) {
  std::erase_if(cloud.channels, [&](const Channel& c) { return layout.find(c.info.name) == nullptr; });
}

Result<std::unique_ptr<PointSource>> open_input(const std::string& path, const UpdateRequest& r) {
  ReadOptions read;
  read.unit_m = r.unit_m;
  return open_source(path, read);
}

/// The first points of the first input tell the service what will come.
Status create_for(const MapClient& client, const UpdateRequest& r) {
  MAPCODEC_ASSIGN(const auto source, open_input(r.inputs.front(), r));
  NewMap map;
  map.promise = r.create->promise;
  map.promise_m = r.create->promise == PromiseKind::lossless ? 0 : r.create->promise_m;
  map.color_error = r.create->color_error;
  map.tile_size_m = r.create->tile_size_m;
  map.sample = source->layout();
  PointCloud block;
  while (map.sample.size() < kSamplePoints) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    map.sample.append(block, 0, std::min(block.size(), kSamplePoints - map.sample.size()));
  }
  return client.create(map);
}

Result<MapSchema> schema_of(const std::string& map) {
  MAPCODEC_ASSIGN(const MapFile file, MapFile::open(map));
  return file.schema();
}

Status send_file(ScanSender& sender, const std::string& path, const UpdateRequest& r, const MapSchema& schema,
                 UpdateReport& report, std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(const auto source, open_input(path, r));
  say_unkept(path, source->layout(), schema, warnings);
  const PointCloud layout = schema.layout();
  PointCloud block;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    Scan scan;
    scan.points = std::exchange(block, {});
    keep_only(scan.points, layout);
    report.points_in += scan.points.size();
    scan.submap = r.submap;
    if (r.pose) (r.submap.empty() ? scan.T_submap_scan : scan.T_map_submap) = r.pose;
    MAPCODEC_TRY(sender.send(std::move(scan)));
    if (r.settings.stop != nullptr && *r.settings.stop) return make_error(ErrorCode::kCancelled, "stopped");
  }
  for (const std::string& w : source->warnings()) warnings.push_back(w);
  return {};
}

std::string writer_name() {
  return "mapcodec-" + std::to_string(::getpid()) + "-" +
         std::to_string(std::chrono::system_clock::now().time_since_epoch().count());
}

Result<std::unique_ptr<ScanSender>> open_sender(const MapClient& client) {
  SenderSettings settings;
  settings.writer = writer_name();
  settings.retry_s = client.url().map.empty() ? 0 : ClientSettings::from_environment().timeout_s;
  return ScanSender::open(client, settings);
}

}  // namespace

void use_services() {
  register_map_scheme();
}

bool is_remote(const std::string& map) {
  return is_map_url(map);
}

Result<UpdateReport> update_remote(const std::string& map, const UpdateRequest& r,
                                   std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  auto schema = schema_of(map);
  if (!schema.ok() && schema.error().code == ErrorCode::kNotFound && r.create) {
    MAPCODEC_TRY(create_for(client, r));
    schema = schema_of(map);
  }
  if (!schema.ok()) return schema.error();
  const bool same = !r.promise || (*r.promise == schema->promise && r.promise_m == schema->promise_value);
  if (!same)
    return make_error(ErrorCode::kInvalidArgument,
                      "the map promises something else: an update cannot change that");
  MAPCODEC_ASSIGN(const auto sender, open_sender(client));
  UpdateReport report;
  for (const std::string& path : r.inputs)
    MAPCODEC_TRY(send_file(*sender, path, r, *schema, report, warnings));
  MAPCODEC_ASSIGN(report.revision, sender->finish());
  report.committed = true;
  return report;
}

Result<UpdateReport> merge_remote(const std::string& map, const MergeRequest& r,
                                  std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  MAPCODEC_ASSIGN(const MapSchema schema, schema_of(map));
  MAPCODEC_ASSIGN(const auto sender, open_sender(client));
  const PointCloud layout = schema.layout();
  UpdateReport report;
  for (const std::string& path : r.others) {
    MAPCODEC_ASSIGN(const MapFile other, MapFile::open(path));
    const auto octree = octree_submap(other.archive().info());
    if (other.schema().occupancy)
      return make_error(ErrorCode::kUnsupported,
                        path + ": is a map of an octree alone: a service takes points");
    if (octree) warnings.push_back(path + ": its octree is left out: a service takes points");
    say_unkept(path, other.schema().layout(), schema, warnings);
    for (std::size_t i = 0; i < other.archive().tiles().size(); ++i) {
      const std::uint32_t number = other.archive().tiles()[i].submap;
      if (number == octree) continue;
      const auto& submaps = other.archive().info().submaps;
      const bool apart = !r.fuse && number < submaps.size() && !submaps[number].name.empty();
      Scan scan;
      MAPCODEC_ASSIGN(scan.points, apart ? other.read_tile_in_submap(i) : other.read_tile(i));
      keep_only(scan.points, layout);
      report.points_in += scan.points.size();
      if (apart) {
        scan.submap = submaps[number].name;
        scan.T_map_submap = PoseChange{0, submaps[number].translation_m, submaps[number].rotation_xyzw};
      }
      MAPCODEC_TRY(sender->send(std::move(scan)));
    }
  }
  MAPCODEC_ASSIGN(report.revision, sender->finish());
  report.committed = true;
  return report;
}

Result<UpdateReport> erase_remote(const std::string& map, const std::optional<Erasure>& e,
                                  const std::string& submap) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  UpdateReport report;
  MAPCODEC_ASSIGN(report.revision, client.erase(e, submap.empty() ? std::nullopt : std::optional(submap)));
  report.committed = true;
  return report;
}

Result<std::uint64_t> set_poses_remote(const std::string& map,
                                       const std::vector<std::pair<std::string, PoseChange>>& poses) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  std::vector<MapService::NamedPose> named;
  for (const auto& [name, pose] : poses) named.push_back({name, pose});
  return client.set_poses(named);
}

Result<std::uint64_t> snapshot_remote(const std::string& map, const std::string& name, bool remove) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  return client.snapshot(name, remove);
}

Result<std::uint64_t> rollback_remote(const std::string& map, const std::string& revision) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  return client.rollback(revision);
}

Result<CompactReport> compact_remote(const std::string& map, std::uint64_t keep_last) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  return client.compact(keep_last);
}

Result<CompressReport> compress_remote(const std::vector<std::string>& inputs, const std::string& map,
                                       CompressOptions options) {
  namespace fs = std::filesystem;
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(map));
  if (options.overwrite) {
    const Status gone = client.remove();
    if (!gone.ok() && gone.error().code != ErrorCode::kNotFound) return gone.error();
  }
  std::error_code error;
  const fs::path file = fs::temp_directory_path(error) / (writer_name() + ".mapc");
  auto report = compress_files(inputs, file.string(), std::move(options));
  const auto sent = report.ok() ? client.upload(file.string()) : Result<std::uint64_t>(report.error());
  fs::remove(file, error);
  if (!sent.ok()) return sent.error();
  return report;
}

}  // namespace mapcodec::cli
