// SPDX-License-Identifier: GPL-3.0-or-later
// The service without a network: maps, queues, commits, views, watchers.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <future>
#include <random>
#include <thread>

#include "maps/map_writer.hpp"
#include "maps/service/map_service.hpp"
#include "maps/service/segment_cache.hpp"
#include "maps/service/watch_list.hpp"
#include "maps/service/writer_table.hpp"
#include "slam_adapter/updater_coding.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;

PointCloud cloud_of(unsigned seed, std::size_t count, double spread = 20) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> place(-spread, spread);
  PointCloud c;
  c.coordinates.kind = CoordinateFormat::Kind::f64;
  for (std::size_t i = 0; i < count; ++i) c.xyz.push_back({place(random), place(random), place(random)});
  return c;
}

class ServiceMaps : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("mapcodec-service-" + std::to_string(::getpid()) + "-" +
                                           ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    settings_.folder = folder_.string();
    settings_.compact_idle_s = 0;
    open();
  }
  void TearDown() override {
    service_ = nullptr;
    fs::remove_all(folder_);
  }
  void open() {
    auto opened = MapService::open(settings_, coding_, catalogue_, metrics_);
    ASSERT_TRUE(opened.ok()) << opened.error().to_string();
    service_ = std::move(opened).value();
  }
  void create(const std::string& name, PromiseKind promise = PromiseKind::max_error) {
    NewMap map;
    map.promise = promise;
    map.promise_m = promise == PromiseKind::lossless ? 0 : 0.01;
    const Status s = service_->create(name, map, {}, "test");
    ASSERT_TRUE(s.ok()) << s.error().to_string();
  }
  /// Waits for the commit.
  Result<ScanReceipt> put(const std::string& name, Scan scan) {
    std::promise<Result<ScanReceipt>> done;
    MAPCODEC_TRY(
        service_->insert(name, std::move(scan), [&](const Result<ScanReceipt>& r) { done.set_value(r); }));
    return done.get_future().get();
  }
  static Scan scan_of(unsigned seed, std::size_t count = 1000) {
    Scan s;
    s.points = cloud_of(seed, count);
    return s;
  }
  std::uint64_t points(const std::string& name) {
    const auto s = service_->stats(name);
    return s.ok() ? s->points : 0;
  }

  fs::path folder_;
  ServiceSettings settings_;
  Arena arena_{2};
  UpdaterCoding coding_{arena_};
  MemoryCatalogue catalogue_;
  NoMetrics metrics_;
  std::unique_ptr<MapService> service_;
};

TEST_F(ServiceMaps, NamesThatAreNone) {
  for (const char* name : {"", ".", "..", "../a", "a/b", ".a", "-a", "a b", "a\n", "\xC3\xA4"})
    EXPECT_FALSE(is_map_name(name)) << name;
  for (const char* name : {"a", "A-1_b.c", "_", "0"}) EXPECT_TRUE(is_map_name(name)) << name;
  EXPECT_FALSE(is_map_name(std::string(101, 'a')));
  EXPECT_EQ(service_->view("../a").error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(service_->view("a").error().code, ErrorCode::kNotFound);
}

TEST_F(ServiceMaps, ScansBecomeRevisionsAndStay) {
  create("m");
  const auto first = put("m", scan_of(1));
  ASSERT_TRUE(first.ok()) << first.error().to_string();
  EXPECT_EQ(first->revision, 2u);
  EXPECT_EQ(points("m"), 1000u);
  service_ = nullptr;
  open();
  EXPECT_EQ(points("m"), 1000u);
  ASSERT_TRUE(put("m", scan_of(2)).ok());
  EXPECT_EQ(points("m"), 2000u);
}

TEST_F(ServiceMaps, ManyScansShareACommit) {
  create("m");
  settings_.commit_after_s = 0.2;
  service_ = nullptr;
  open();
  std::atomic<int> done{0};
  for (unsigned i = 0; i < 50; ++i)
    ASSERT_TRUE(
        service_->insert("m", scan_of(i, 100), [&](const Result<ScanReceipt>& r) { done += r.ok(); }).ok());
  service_->drain();
  EXPECT_EQ(done, 50);
  EXPECT_EQ(points("m"), 5000u);
  EXPECT_LE(service_->stats("m")->revision, 4u);
  EXPECT_EQ(service_->insert("m", scan_of(1), [](const Result<ScanReceipt>&) {}).error().code,
            ErrorCode::kBusy);
}

TEST_F(ServiceMaps, AFullQueueSaysBusyAndDoesNotGrow) {
  create("m");
  settings_.queue_points = 5000;
  settings_.commit_after_s = 0.3;
  service_ = nullptr;
  open();
  std::atomic<int> done{0};
  int busy = 0;
  for (unsigned i = 0; i < 20; ++i) {
    const Status s = service_->insert("m", scan_of(i), [&](const Result<ScanReceipt>&) { ++done; });
    if (!s.ok()) {
      EXPECT_EQ(s.error().code, ErrorCode::kBusy);
    }
    busy += !s.ok();
    EXPECT_LE(service_->stats().queued_points, 6000u);
  }
  EXPECT_GT(busy, 0);
  EXPECT_GT(service_->retry_after_ms(), 0u);
  service_->drain();
  EXPECT_EQ(done + busy, 20);
  EXPECT_EQ(service_->stats().queued_points, 0u);
}

TEST_F(ServiceMaps, ABadScanLeavesOthersAlone) {
  create("m");
  Scan nan = scan_of(1, 10);
  nan.points.xyz[7][1] = NAN;
  EXPECT_EQ(put("m", nan).error().code, ErrorCode::kInvalidArgument);
  Scan far = scan_of(1, 10);
  far.points.xyz[3][0] = 1e200;
  EXPECT_EQ(put("m", far).error().code, ErrorCode::kInvalidArgument);
  Scan channels = scan_of(1, 10);
  channels.points.channels.push_back({{"intensity", ScalarType::f32, 1}, Bytes(7)});
  EXPECT_EQ(put("m", channels).error().code, ErrorCode::kMalformed);
  Scan pose = scan_of(1, 10);
  pose.T_map_submap = PoseChange{};
  EXPECT_EQ(put("m", pose).error().code, ErrorCode::kInvalidArgument);
  Scan gap = scan_of(1, 10);
  gap.writer = "w";
  gap.sequence = 5;
  EXPECT_EQ(put("m", gap).error().code, ErrorCode::kInvalidArgument);
  ASSERT_TRUE(put("m", scan_of(2)).ok());
  EXPECT_EQ(points("m"), 1000u);
}

TEST_F(ServiceMaps, WritersCountOnceAcrossRestarts) {
  create("m", PromiseKind::lossless);
  for (std::uint64_t i = 1; i <= 3; ++i) {
    Scan s = scan_of(unsigned(i), 100);
    s.writer = "robot";
    s.sequence = i;
    ASSERT_TRUE(put("m", s).ok());
  }
  service_ = nullptr;
  open();
  EXPECT_EQ(*service_->last_sequence("m", "robot"), 3u);
  Scan again = scan_of(3, 100);
  again.writer = "robot";
  again.sequence = 3;
  const auto r = put("m", again);
  ASSERT_TRUE(r.ok());
  EXPECT_TRUE(r->repeated);
  EXPECT_EQ(points("m"), 300u);
}

TEST_F(ServiceMaps, ViewsStayAndWatchersAreTold) {
  create("m");
  std::atomic<int> told{0};
  auto watcher = service_->watch("m", [&] { ++told; });
  ASSERT_TRUE(watcher.ok());
  const MapViewPtr old = service_->view("m").value();
  ASSERT_TRUE(put("m", scan_of(1)).ok());
  EXPECT_EQ(old->archive->revision(), 1u);
  EXPECT_EQ(service_->view("m").value()->archive->revision(), 2u);
  EXPECT_EQ(service_->view("m").value(), service_->view("m").value());
  EXPECT_GE(told, 1);
  *watcher = nullptr;
  const int before = told;
  ASSERT_TRUE(put("m", scan_of(2)).ok());
  EXPECT_EQ(told, before);
}

TEST_F(ServiceMaps, SnapshotsRollbackAndCompaction) {
  create("m");
  ASSERT_TRUE(put("m", scan_of(1)).ok());
  EXPECT_EQ(*service_->snapshot("m", "one"), 2u);
  ASSERT_TRUE(put("m", scan_of(2)).ok());
  EXPECT_EQ(points("m"), 2000u);
  EXPECT_EQ(service_->view("m", "one").value()->archive->revision(), 2u);
  ASSERT_TRUE(service_->rollback("m", "one").ok());
  EXPECT_EQ(points("m"), 1000u);
  const MapViewPtr before = service_->view("m").value();
  const auto report = service_->compact("m", {1});
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_EQ(points("m"), 1000u);
  EXPECT_NE(service_->view("m").value()->file, before->file);
  EXPECT_EQ(service_->view_of_file("m", before->file).value(), before);
  for (std::size_t i = 0; i < before->archive->tiles().size(); ++i)
    EXPECT_TRUE(service_->segments(*before, i).ok());
}

TEST_F(ServiceMaps, IdleMapsAreCompacted) {
  create("m");
  settings_.compact_idle_s = 0.2;
  service_ = nullptr;
  open();
  for (unsigned i = 0; i < 6; ++i) ASSERT_TRUE(put("m", scan_of(i)).ok());
  bool folded = false;
  for (int i = 0; i < 100 && !folded; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const auto archive = MapArchive::open((folder_ / "m.mapc").string());
    ASSERT_TRUE(archive.ok());
    folded = std::all_of(archive->tiles().begin(), archive->tiles().end(),
                         [](const TileRecord& t) { return t.segments.size() == 1; });
  }
  EXPECT_TRUE(folded);
  EXPECT_EQ(points("m"), 6000u);
}

TEST_F(ServiceMaps, MapsThatNeverRestAreCompactedBeforeTheyDrown) {
  create("m");
  settings_.compact_idle_s = 1000;
  settings_.compact_must_share = 0.2;
  settings_.compact_must_bytes = 1000;
  service_ = nullptr;
  open();
  const std::uint64_t file = service_->view("m").value()->file;
  bool compacted = false;
  std::size_t scans = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!compacted && std::chrono::steady_clock::now() < end) {
    ASSERT_TRUE(put("m", scan_of(unsigned(scans++))).ok());
    compacted = service_->view("m").value()->file != file;
  }
  EXPECT_TRUE(compacted);
  EXPECT_EQ(points("m"), 1000u * scans);
}

TEST_F(ServiceMaps, OthersMayWriteWhileWeDoNot) {
  create("m");
  EXPECT_EQ(service_->view("m").value()->archive->revision(), 1u);
  {
    auto writer = MapWriter::open((folder_ / "m.mapc").string());
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->add_snapshot("s").ok());
    ASSERT_TRUE(writer->commit(0).ok());
  }
  EXPECT_EQ(service_->view("m").value()->archive->revision(), 2u);
}

TEST_F(ServiceMaps, AMapThatGoesAway) {
  create("m");
  const MapViewPtr view = service_->view("m").value();
  ASSERT_TRUE(put("m", scan_of(1)).ok());
  ASSERT_TRUE(service_->remove("m").ok());
  EXPECT_FALSE(fs::exists(folder_ / "m.mapc"));
  EXPECT_EQ(service_->view("m").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(view->archive->revision(), 1u);
  create("m");
  EXPECT_EQ(points("m"), 0u);
}

TEST(SegmentCache, KeepsToItsBudgetAndForgetsTheOldest) {
  SegmentCache cache(1000);
  const auto bytes = [](std::size_t n) { return std::make_shared<const Bytes>(n); };
  for (std::uint64_t i = 0; i < 10; ++i) cache.put({1, i}, bytes(100));
  EXPECT_EQ(cache.bytes(), 1000u);
  EXPECT_NE(cache.find({1, 0}), nullptr);
  cache.put({1, 10}, bytes(100));
  EXPECT_NE(cache.find({1, 0}), nullptr);  // was used
  EXPECT_EQ(cache.find({1, 1}), nullptr);
  cache.put({1, 11}, bytes(126));  // more than an eighth
  EXPECT_EQ(cache.find({1, 11}), nullptr);
  EXPECT_LE(cache.bytes(), 1000u);
}

TEST(WriterTable, ComesBackAndForgetsTheOldest) {
  WriterTable table;
  for (std::uint64_t i = 0; i < 300; ++i) table.set("w" + std::to_string(i), i + 1);
  EXPECT_EQ(table.last("w0"), 0u);
  EXPECT_EQ(table.last("w299"), 300u);
  MapInfo info;
  info.extras[kWritersExtra] = table.write();
  EXPECT_EQ(WriterTable::read(info).last("w299"), 300u);
  const Bytes whole = table.write();
  for (std::size_t cut = 0; cut < whole.size(); cut += 7) {
    info.extras[kWritersExtra] = Bytes(whole.begin(), whole.begin() + std::ptrdiff_t(cut));
    EXPECT_EQ(WriterTable::read(info).last("w299"), 0u);
  }
}

}  // namespace
}  // namespace mapcodec
