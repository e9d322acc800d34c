// SPDX-License-Identifier: GPL-3.0-or-later
// What the archive itself costs, with tiles of random bytes: commit latency, opening, compaction, poses,
// hashes.
//   measure_archive [TILES] [BYTES PER TILE]      prints JSON; default 100000 tiles of 20000 bytes
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <random>

#include "maps/compaction.hpp"
#include "maps/map_archive.hpp"
#include "maps/map_changes.hpp"
#include "maps/map_writer.hpp"

namespace mapcodec::fault {
namespace {

double seconds(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

[[noreturn]] void die(const Error& error) {
  std::fprintf(stderr, "measure_archive: %s\n", error.to_string().c_str());
  std::exit(1);
}
template <class T>
T must(Result<T> result) {
  if (!result.ok()) die(result.error());
  return std::move(result).value();
}
void must(const Status& status) {
  if (!status.ok()) die(status.error());
}

/// Random bytes of which each tile takes another window: no two are alike, none is compressible.
class TileSource {
 public:
  explicit TileSource(std::size_t bytes) : bytes_(bytes), pool_(bytes + (1 << 20)) {
    std::mt19937_64 random(1);
    for (std::uint8_t& b : pool_) b = static_cast<std::uint8_t>(random());
  }
  ByteSpan next() {
    at_ = (at_ + 7919) % (1 << 20);
    return ByteSpan(pool_).subspan(at_, bytes_);
  }

 private:
  std::size_t bytes_, at_ = 0;
  Bytes pool_;
};

MapInfo info_of(std::size_t submaps) {
  MapInfo info;
  info.tile_size_m = 10;
  info.schema = {1, 2, 3};
  for (std::size_t i = 0; i < submaps; ++i) {
    Submap s;
    s.name = "keyframe " + std::to_string(i);
    info.submaps.push_back(s);
  }
  return info;
}

TileKey key_of(std::size_t i) {
  return {static_cast<std::int32_t>(i % 320), static_cast<std::int32_t>(i / 320), 0, 0};
}

void add(MapWriter& writer, const TileKey& key, TileSource& source, std::uint32_t submap = 0) {
  std::mt19937_64 random(static_cast<std::uint64_t>(key.x * 1000 + key.y));
  std::uniform_real_distribution<double> part(0, 1);
  Box box = tile_cube(key, {0, 0, 0}, 10);
  box.max[2] = box.min[2] + 10 * part(random);
  must(writer.add(key, 4, 90000 + random() % 20000, box, {0.01 * part(random), 0.03, 0, part(random)},
                  source.next(), submap));
}

struct Latency {
  double p50 = 0, p99 = 0, worst = 0;
};
Latency latency(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  const auto at = [&](double q) {
    return 1e3 * samples[static_cast<std::size_t>(q * double(samples.size() - 1))];
  };
  return {at(0.5), at(0.99), at(1)};
}

void measure_large(const std::string& path, std::size_t tiles, std::size_t bytes) {
  TileSource source(bytes);
  const double writing = seconds([&] {
    auto writer = must(MapWriter::create(path, info_of(0), true));
    for (std::size_t i = 0; i < tiles; ++i) add(writer, key_of(i), source);
    must(writer.commit(1));
  });
  const double mb = 1e-6 * double(std::filesystem::file_size(path));
  std::printf(" \"tiles\": %zu, \"megabytes\": %.1f, \"write_MB_per_s\": %.0f,\n", tiles, mb, mb / writing);
  std::vector<double> commits;
  {
    auto writer = must(MapWriter::open(path));
    std::mt19937_64 random(3);
    for (int i = 0; i < 300; ++i) {
      for (int k = 0; k < 20; ++k) add(writer, key_of(random() % tiles), source);
      commits.push_back(seconds([&] { must(writer.commit(i)); }));
    }
  }
  const Latency l = latency(commits);
  std::printf(" \"commit_ms_of_20_tiles\": {\"p50\": %.2f, \"p99\": %.2f, \"worst\": %.2f},\n", l.p50, l.p99,
              l.worst);
  const double opening = seconds([&] { must(MapArchive::open(path)); });
  const double writer_opening = seconds([&] { must(MapWriter::open(path)); });
  const double rollback = seconds([&] {
    auto writer = must(MapWriter::open(path));
    must(writer.restore(1));
    must(writer.commit(9));
  });
  std::printf(" \"open_ms\": %.1f, \"open_for_writing_ms\": %.1f, \"rollback_ms\": %.1f,\n", 1e3 * opening,
              1e3 * writer_opening, 1e3 * rollback);
  const double before = 1e-6 * double(std::filesystem::file_size(path));
  const double compaction = seconds([&] { must(compact_archive(path)); });
  const auto plain = std::filesystem::file_size(path);
  std::printf(" \"compaction_MB_per_s\": %.0f, \"compaction_MB\": [%.1f, %.1f],\n",
              1e-6 * double(plain) / compaction, before, 1e-6 * double(plain));
  CompactSettings settings;
  settings.hashes = true;
  must(compact_archive(path, settings));
  const auto archive = must(MapArchive::open(path));
  const double hashes = seconds([&] { must(missing_tiles(archive, {})); });
  std::printf(" \"hash_bytes_per_tile\": %.2f, \"hashes_percent\": %.4f, \"stored_hashes_ms\": %.1f,\n",
              double(std::filesystem::file_size(path) - plain) / double(tiles),
              100 * double(std::filesystem::file_size(path) - plain) / double(plain), 1e3 * hashes);
  settings.hashes = false;
  must(compact_archive(path, settings));
  const auto bare = must(MapArchive::open(path));
  const double computed = seconds([&] { must(missing_tiles(bare, {})); });
  std::printf(" \"computed_hashes_MB_per_s\": %.0f,\n", 1e-6 * double(plain) / computed);
}

void measure_poses(const std::string& path) {
  TileSource source(2000);
  auto writer = must(MapWriter::create(path, info_of(1000), true));
  for (std::uint32_t s = 0; s < 1000; ++s) {
    for (std::size_t i = 0; i < 20; ++i) add(writer, key_of(i), source, s);
  }
  must(writer.commit(1));
  std::vector<double> times;
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto before = std::filesystem::file_size(path);
  for (int round = 0; round < 50; ++round) {
    std::vector<PoseChange> poses;
    for (std::uint32_t s = 0; s < 1000; ++s) {
      std::array<double, 4> q{normal(random), normal(random), normal(random), normal(random)};
      const double n = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      for (double& v : q) v /= n;
      poses.push_back({s, {normal(random), normal(random), normal(random)}, q});
    }
    times.push_back(seconds([&] {
      must(writer.set_poses(poses));
      must(writer.commit(round));
    }));
  }
  const Latency l = latency(times);
  std::printf(
      " \"pose_change_of_1000_submaps_ms\": {\"p50\": %.2f, \"p99\": %.2f, \"worst\": %.2f}, "
      "\"bytes_each\": %.0f,\n",
      l.p50, l.p99, l.worst, double(std::filesystem::file_size(path) - before) / 50);
  const auto archive = must(MapArchive::open(path));
  std::printf(" \"tiles_changed_by_poses\": %zu,\n", must(changes_since(archive, 1)).size());
  const double query = seconds([&] {
    for (int i = 0; i < 100; ++i) (void)archive.tiles_in({{-10, -10, -10}, {10, 10, 10}});
  });
  std::printf(" \"posed_query_ms\": %.3f\n", 10 * query);
}

}  // namespace
}  // namespace mapcodec::fault

int main(int argc, char** argv) {
  using namespace mapcodec::fault;
  const std::size_t tiles = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 100000;
  const std::size_t bytes = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 20000;
  std::string folder = (std::filesystem::temp_directory_path() / "mapcodec-measure-XXXXXX").string();
  if (!::mkdtemp(folder.data())) return 1;
  std::printf("{\n");
  measure_large(folder + "/large.mapc", tiles, bytes);
  measure_poses(folder + "/poses.mapc");
  std::printf("}\n");
  std::filesystem::remove_all(folder);
}
