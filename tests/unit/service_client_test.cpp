// SPDX-License-Identifier: GPL-3.0-or-later
// The C++ client against the server, in one process.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "maps/service/access.hpp"
#include "slam_adapter/client/map_replica.hpp"
#include "slam_adapter/client/remote_map.hpp"
#include "slam_adapter/client/remote_store.hpp"
#include "slam_adapter/client/scan_sender.hpp"
#include "slam_adapter/octomap/occupancy_map.hpp"
#include "slam_adapter/updater_coding.hpp"
#include "tests/unit/occupancy_support.hpp"
#include "tools/mapcodecd/grpc/server.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;

Scan scan_of(unsigned seed, std::size_t count, double x = 0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-15, 15);
  Scan s;
  for (std::size_t i = 0; i < count; ++i)
    s.points.xyz.push_back({place(random) + x, double(place(random)), double(place(random))});
  for (Vec3& p : s.points.xyz) p[0] = float(p[0]);
  return s;
}

std::string bytes_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class ServiceClient : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("mapcodec-client-" + std::to_string(::getpid()) + "-" +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "maps");
    settings_.timeout_s = 10;
    // A socket stays where it is when the server is started again.
    grpc_.listen = {"unix:" + (folder_ / "s").string()};
    start();
    auto client = MapClient::connect(url(), settings_);
    ASSERT_TRUE(client.ok()) << client.error().to_string();
    client_ = std::make_unique<MapClient>(std::move(client).value());
    NewMap map;
    map.promise = PromiseKind::max_error;
    map.promise_m = 0.01;
    const Status s = client_->create(map);
    ASSERT_TRUE(s.ok()) << s.error().to_string();
  }
  void TearDown() override {
    stop();
    fs::remove_all(folder_);
  }
  void start() {
    ServiceSettings settings;
    settings.folder = (folder_ / "maps").string();
    auto service = MapService::open(settings, coding_, catalogue_, metrics_);
    ASSERT_TRUE(service.ok()) << service.error().to_string();
    service_ = std::move(service).value();
    auto server = daemon::GrpcServer::start(grpc_, *service_, *access_, metrics_, {});
    ASSERT_TRUE(server.ok()) << server.error().to_string();
    server_ = std::move(server).value();
  }
  void stop() {
    if (server_) server_->stop(std::chrono::system_clock::now() + std::chrono::seconds(5));
    server_ = nullptr;
    service_ = nullptr;
  }
  [[nodiscard]] std::string url() const { return "mapcodec://" + grpc_.listen.front() + "/m"; }
  void send(unsigned seed, std::size_t count, double x = 0) {
    auto sender = ScanSender::open(*client_, {});
    ASSERT_TRUE(sender.ok()) << sender.error().to_string();
    ASSERT_TRUE((*sender)->send(scan_of(seed, count, x)).ok());
    const auto revision = (*sender)->finish();
    ASSERT_TRUE(revision.ok()) << revision.error().to_string();
  }

  fs::path folder_;
  Arena arena_{2};
  UpdaterCoding coding_{arena_};
  MemoryCatalogue catalogue_;
  NoMetrics metrics_;
  std::unique_ptr<AccessControl> access_ = open_access();
  daemon::GrpcSettings grpc_;
  ClientSettings settings_;
  std::unique_ptr<MapService> service_;
  std::unique_ptr<daemon::GrpcServer> server_;
  std::unique_ptr<MapClient> client_;
};

TEST(MapUrl, IsReadOrRefused) {
  EXPECT_EQ(parse_map_url("mapcodec://h:1/m")->address, "h:1");
  EXPECT_EQ(parse_map_url("mapcodec://h:1/m")->map, "m");
  EXPECT_EQ(parse_map_url("mapcodec://[::1]:7/m")->address, "[::1]:7");
  EXPECT_EQ(parse_map_url("mapcodec://unix:/a/b/m")->address, "unix:/a/b");
  EXPECT_EQ(parse_map_url("mapcodec://h:1")->map, "");
  for (const char* bad :
       {"", "m", "mapcodec://", "mapcodec://h/m", "mapcodec://h:/m", "mapcodec://h:1/a/b", "http://h:1/m"})
    EXPECT_FALSE(parse_map_url(bad).ok()) << bad;
}

TEST_F(ServiceClient, CallsAndTheirErrors) {
  EXPECT_EQ(client_->list()->size(), 1u);
  EXPECT_EQ(client_->create({}).error().code, ErrorCode::kExists);
  EXPECT_EQ(client_->rollback("77").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(client_->set_poses({{"none", {}}}).error().code, ErrorCode::kNotFound);
  send(1, 3000);
  EXPECT_EQ(client_->stats()->points, 3000u);
  EXPECT_EQ(*client_->snapshot("one"), 2u);
  Erasure all;
  all.box = Box{{-99, -99, -99}, {0, 99, 99}};
  ASSERT_TRUE(client_->erase(all, std::nullopt).ok());
  EXPECT_LT(client_->stats()->points, 2000u);
  ASSERT_TRUE(client_->compact(1).ok());
  stop();
  EXPECT_EQ(client_->stats().error().code, ErrorCode::kUnreachable);
}

TEST_F(ServiceClient, AnOctreeIsNotMoved) {
  send(1, 3000);
  stop();
  const std::string archive = (folder_ / "maps/m.mapc").string();
  ASSERT_TRUE(update_occupancy_map(archive, test::bubble(OccupancyKind::binary, 4), 0.1, {}).ok());
  start();
  const auto before = bytes_of(archive);
  PoseChange moved;
  moved.translation_m = {1, 0, 0};
  const auto refused = client_->set_poses({{"octree", moved}});
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(refused.error().message.find("holds an octree, which lies on its own grid"), std::string::npos)
      << refused.error().message;
  EXPECT_EQ(bytes_of(archive), before);
  EXPECT_TRUE(client_->set_poses({{"octree", {}}}).ok());
}

TEST_F(ServiceClient, AnArchiveIsReadFromAfar) {
  send(1, 20000);
  register_map_scheme();
  const auto archive = MapArchive::open(url());
  ASSERT_TRUE(archive.ok()) << archive.error().to_string();
  EXPECT_EQ(archive->revision(), 2u);
  const auto report = archive->verify();
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(report->ok());
  EXPECT_EQ(client_->upload((folder_ / "maps/m.mapc").string()).error().code, ErrorCode::kExists);
}

TEST_F(ServiceClient, ACopyFetchesWhatDiffersAndIsTheSame) {
  send(1, 20000);
  const std::string path = (folder_ / "copy.mapc").string();
  {
    auto copy = MapReplica::open(*client_, path);
    ASSERT_TRUE(copy.ok());
    const auto first = copy->catch_up();
    ASSERT_TRUE(first.ok()) << first.error().to_string();
    EXPECT_EQ(first->bytes_fetched, first->bytes_whole);
    send(2, 200);
    const auto second = copy->catch_up();
    ASSERT_TRUE(second.ok()) << second.error().to_string();
    EXPECT_LT(second->bytes_fetched, second->bytes_whole / 5);
    EXPECT_EQ(copy->catch_up()->tiles_fetched, 0u);
  }
  // Another process goes on with it; the server compacted, so that what the copy has is gone there.
  send(3, 200);
  ASSERT_TRUE(client_->compact(1).ok());
  {
    auto copy = MapReplica::open(*client_, path);
    ASSERT_TRUE(copy.ok());
    const auto third = copy->catch_up();
    ASSERT_TRUE(third.ok()) << third.error().to_string();
  }
  CompactSettings compact;
  compact.hashes = true;
  ASSERT_TRUE(compact_archive(path, compact).ok());
  stop();
  EXPECT_EQ(bytes_of(path), bytes_of(folder_ / "maps/m.mapc"));
}

TEST_F(ServiceClient, ScansArriveOnceThoughTheServerGoesAway) {
  SenderSettings settings;
  settings.writer = "robot";
  settings.retry_s = 20;
  settings.window_points = 4000;
  auto sender = ScanSender::open(*client_, settings);
  ASSERT_TRUE(sender.ok());
  for (unsigned i = 0; i < 20; ++i) {
    if (i == 7 || i == 13) {
      stop();
      start();
    }
    const Status s = (*sender)->send(scan_of(i, 1000));
    ASSERT_TRUE(s.ok()) << s.error().to_string();
  }
  const auto revision = (*sender)->finish();
  ASSERT_TRUE(revision.ok()) << revision.error().to_string();
  EXPECT_GE((*sender)->reconnects(), 1u);
  EXPECT_EQ((*sender)->acknowledged(), 20u);
  EXPECT_EQ(client_->stats()->points, 20000u);
}

TEST_F(ServiceClient, ARobotThatRestsSendsOn) {
  stop();
  grpc_.idle_stream_s = 0.2;
  start();
  SenderSettings settings;
  settings.writer = "robot";
  auto sender = ScanSender::open(*client_, settings);
  ASSERT_TRUE(sender.ok()) << sender.error().to_string();
  for (unsigned i = 1; i <= 2; ++i) {
    ASSERT_TRUE((*sender)->send(scan_of(i, 1000)).ok());
    const auto revision = (*sender)->finish();
    ASSERT_TRUE(revision.ok()) << revision.error().to_string();
    std::this_thread::sleep_for(std::chrono::milliseconds(2500));
  }
  EXPECT_GE((*sender)->reconnects(), 1u);
  EXPECT_EQ(client_->stats()->points, 2000u);
}

TEST_F(ServiceClient, ALocalMapWorksOnWithoutTheServer) {
  send(1, 20000);
  send(2, 20000, 200);
  RemoteMapSettings settings;
  settings.local.radius_m = 20;
  settings.cache_file = (folder_ / "cache.mapc").string();
  settings.look_every_s = 0.1;
  auto map = RemoteMap::open(url(), settings, arena_);
  ASSERT_TRUE(map.ok()) << map.error().to_string();
  ASSERT_TRUE((*map)->move_to({{0, 0, 0}, {0, 0, 0, 1}}).ok());
  ASSERT_TRUE((*map)->wait_fetched(20));
  ASSERT_TRUE((*map)->local().wait_ready(20).ok());
  EXPECT_GE((*map)->local().view()->points(), 19000u);
  EXPECT_LT((*map)->local().view()->points(), 21000u);
  stop();
  ASSERT_TRUE((*map)->move_to({{1, 0, 0}, {0, 0, 0, 1}}).ok());
  EXPECT_FALSE((*map)->wait_fetched(30));
  EXPECT_FALSE((*map)->state().online);
  ASSERT_TRUE((*map)->local().wait_ready(20).ok());
  EXPECT_GE((*map)->local().view()->points(), 19000u);
  start();
  send(3, 5000);
  ASSERT_TRUE((*map)->move_to({{200, 0, 0}, {0, 0, 0, 1}}).ok());
  bool there = false;
  for (int i = 0; i < 100 && !there; ++i) there = (*map)->wait_fetched(1);
  ASSERT_TRUE(there);
  bool ready = false;
  for (int i = 0; i < 100 && !ready; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    ready = (*map)->local().view()->points() >= 19000;
  }
  EXPECT_TRUE(ready);
}

}  // namespace
}  // namespace mapcodec
