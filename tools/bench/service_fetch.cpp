// SPDX-License-Identifier: GPL-3.0-or-later
#include <grpcpp/grpcpp.h>
#include <spdlog/fmt/fmt.h>

#include <filesystem>
#include <random>

#include "maps/map_writer.hpp"
#include "maps/service/v1/map_service.grpc.pb.h"
#include "slam_adapter/client/map_client.hpp"
#include "slam_adapter/updater_coding.hpp"
#include "tools/bench/service.hpp"
#include "tools/mapcodecd/grpc/server.hpp"
#include "tools/peers/grid.hpp"

namespace mapcodec::bench {
namespace {

using Watch = peers::StopWatch;

constexpr std::size_t kTileBytes = 65536;

/// Sends messages of a tile's size from memory: what gRPC itself can do.
class BareService final : public v1::MapService::CallbackService {
 public:
  explicit BareService(std::size_t messages) : messages_(messages), data_(kTileBytes, 'x') {}
  grpc::ServerWriteReactor<v1::GetTilesReply>* GetTiles(grpc::CallbackServerContext*,
                                                        const v1::GetTilesRequest*) override {
    class Stream final : public grpc::ServerWriteReactor<v1::GetTilesReply> {
     public:
      Stream(std::size_t left, const std::string& data) : left_(left) {
        reply_.set_data(data);
        next();
      }
      void OnWriteDone(bool ok) override { ok ? next() : Finish(grpc::Status::CANCELLED); }
      void OnDone() override { delete this; }

     private:
      void next() {
        if (left_-- == 0) {
          Finish(grpc::Status::OK);
        } else {
          StartWrite(&reply_);
        }
      }
      std::size_t left_;
      v1::GetTilesReply reply_;
    };
    return new Stream(messages_, data_);
  }

 private:
  const std::size_t messages_;
  const std::string data_;
};

/// An archive of tiles of 64 kB of noise: the service never looks inside.
Status write_map(const std::string& path, std::size_t tiles) {
  MapSchema schema;
  schema.promise = PromiseKind::max_error;
  schema.promise_value = 0.01;
  schema.step_m = 0.02;
  schema.tile_size_m = 10;
  MapInfo info;
  info.schema = write_schema(schema);
  info.tile_size_m = schema.tile_size_m;
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path, info, true));
  writer.store_hashes(true);
  std::mt19937_64 random(1);
  Bytes bytes(kTileBytes);
  for (std::size_t i = 0; i < tiles; ++i) {
    for (std::size_t b = 0; b < bytes.size(); b += 8) {
      const std::uint64_t v = random();
      std::memcpy(bytes.data() + b, &v, 8);
    }
    const TileKey key{std::int32_t(i % 64), std::int32_t(i / 64), 0, 0};
    MAPCODEC_TRY(writer.add(key, 1, 1000, tile_cube(key, info.origin, info.tile_size_m), {}, bytes));
  }
  MAPCODEC_TRY(writer.commit(0));
  return {};
}

/// One stream, read as fast as it comes, no more done with it than gRPC does.
/// @return MB/s. @param cpu_s  of this whole process, client and server.
Result<double> pull(v1::MapService::Stub& stub, double& cpu_s) {
  grpc::ClientContext context;
  v1::GetTilesRequest request;
  request.set_map("m");
  const Watch watch(Watch::Kind::wall), cpu(Watch::Kind::whole_process);
  const auto reader = stub.GetTiles(&context, request);
  v1::GetTilesReply reply;
  std::uint64_t bytes = 0;
  while (reader->Read(&reply)) bytes += reply.data().size();
  if (const grpc::Status s = reader->Finish(); !s.ok())
    return make_error(ErrorCode::kUnreachable, s.error_message());
  cpu_s += cpu.seconds();
  return double(bytes) / watch.seconds() / 1e6;
}

std::shared_ptr<grpc::Channel> channel_to(const std::string& address) {
  return grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
}

/// Times to one tile by its key, from a client at rest [s].
Result<std::vector<double>> single_tiles(const std::string& address, std::size_t tiles, int count) {
  MAPCODEC_ASSIGN(const MapClient client, MapClient::connect("mapcodec://" + address + "/m"));
  std::mt19937 random(3);
  std::vector<double> times;
  for (int i = 0; i < count; ++i) {
    const std::size_t n = random() % tiles;
    TileRequest request;
    request.selection.keys.push_back({0, {std::int32_t(n % 64), std::int32_t(n / 64), 0, 0}});
    const Watch watch(Watch::Kind::wall);
    std::uint64_t bytes = 0;
    const auto take = [&](RemoteTile&& t) -> Status {
      bytes += t.segments.front().size();
      return {};
    };
    MAPCODEC_TRY(client.tiles(request, nullptr, take));
    if (bytes != kTileBytes) return make_error(ErrorCode::kTruncated, "a tile did not come whole");
    times.push_back(watch.seconds());
  }
  return times;
}

}  // namespace

Status measure_fetch(const BenchSettings& settings, Report& report) {
  const std::size_t tiles = settings.quick ? 1000 : 4000;
  const std::string folder = report.scratch() + ".fetch";
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  MAPCODEC_TRY(write_map(folder + "/m.mapc", tiles));
  Arena arena(settings.threads);
  UpdaterCoding coding(arena);
  MemoryCatalogue catalogue;
  NoMetrics metrics;
  const auto access = open_access();
  ServiceSettings service_settings;
  service_settings.folder = folder;
  service_settings.cache_bytes = std::uint64_t{1} << 30;
  MAPCODEC_ASSIGN(const auto service, MapService::open(service_settings, coding, catalogue, metrics));
  daemon::GrpcSettings grpc_settings;
  grpc_settings.listen = {"127.0.0.1:0"};
  MAPCODEC_ASSIGN(const auto server,
                  daemon::GrpcServer::start(grpc_settings, *service, *access, metrics, {}));
  BareService bare(tiles);
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&bare);
  const auto bare_server = builder.BuildAndStart();
  const auto ours = v1::MapService::NewStub(channel_to(server->addresses().front()));
  const auto plain = v1::MapService::NewStub(channel_to("127.0.0.1:" + std::to_string(port)));
  std::vector<double> our_speed, bare_speed, ratio;
  double our_cpu = 0, bare_cpu = 0, warm_up = 0;
  MAPCODEC_TRY(pull(*ours, warm_up));
  MAPCODEC_TRY(pull(*plain, warm_up));
  const int rounds = settings.quick ? 7 : 15;
  for (int i = 0; i < rounds; ++i) {
    MAPCODEC_ASSIGN(const double a, pull(*ours, our_cpu));
    MAPCODEC_ASSIGN(const double b, pull(*plain, bare_cpu));
    our_speed.push_back(a);
    bare_speed.push_back(b);
    ratio.push_back(a / b);
  }
  MAPCODEC_ASSIGN(const std::vector<double> single,
                  single_tiles(server->addresses().front(), tiles, settings.quick ? 500 : 3000));
  const double speed = quantile(our_speed, 0.5);
  report.line(fmt::format("\n## {} tiles of 64 kB, one reader, service and reader in one process\n", tiles));
  report.table({"", "MB/s", "tiles/s", "CPU s/GB", "of bare (median of pairs)", "one tile p50 ms", "p99 ms"});
  const double gigabytes = 1e-9 * double(rounds) * double(tiles * kTileBytes);
  report.row({"GetTiles", digits(speed), digits(speed * 1e6 / double(kTileBytes)),
              digits(our_cpu / gigabytes), digits(quantile(ratio, 0.5)), digits(1e3 * quantile(single, 0.5)),
              digits(1e3 * quantile(single, 0.99))});
  report.row({"bare stream", digits(quantile(bare_speed, 0.5)),
              digits(quantile(bare_speed, 0.5) * 1e6 / double(kTileBytes)), digits(bare_cpu / gigabytes), "1",
              "", ""});
  report.json()["fetch"] = {{"mb_per_second", speed},
                            {"bare_mb_per_second", quantile(bare_speed, 0.5)},
                            {"ratio", quantile(ratio, 0.5)},
                            {"cpu_seconds_per_gb", our_cpu / gigabytes},
                            {"bare_cpu_seconds_per_gb", bare_cpu / gigabytes},
                            {"single_p50_s", quantile(single, 0.5)},
                            {"single_p99_s", quantile(single, 0.99)}};
  bare_server->Shutdown();
  server->stop(std::chrono::system_clock::now());
  std::filesystem::remove_all(folder, ignored);
  return {};
}

}  // namespace mapcodec::bench
