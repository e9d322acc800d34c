// SPDX-License-Identifier: GPL-3.0-or-later
// Octrees: size beside the file and zstd, time beside OctoMap's reading and building, and a box out of a
// large map.
#include <octomap/ColorOcTree.h>
#include <octomap/octomap.h>
#include <spdlog/fmt/fmt.h>
#include <time.h>
#include <zstd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "mapcodec/cloud/occupancy_edit.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/occupancy_encoder.hpp"
#include "slam_adapter/octomap/octomap_tree.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec {
namespace {

using bench::digits;
using bench::Json;
namespace fs = std::filesystem;

constexpr int kRepeats = 5;

/// Processor time of this thread [s]: other programs on the machine do not count.
double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}
template <class F>
double seconds_of(F&& f) {
  const double begin = cpu_seconds();
  f();
  return cpu_seconds() - begin;
}

std::string slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}
ByteSpan bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

std::uint64_t zstd_bytes(const std::string& plain) {
  std::string out(ZSTD_compressBound(plain.size()), '\0');
  return ZSTD_compress(out.data(), out.size(), plain.data(), plain.size(), 19);
}

/// OctoMap talks while it reads.
class Quiet {
 public:
  Quiet() : out_(std::cout.rdbuf(nullptr)), err_(std::cerr.rdbuf(nullptr)) {}
  ~Quiet() {
    std::cout.rdbuf(out_);
    std::cerr.rdbuf(err_);
  }

 private:
  std::streambuf *out_, *err_;
};

std::unique_ptr<octomap::AbstractOcTree> octomap_read(const std::string& text) {
  const Quiet quiet;
  std::istringstream in(text);
  if (text.find("binary") < 40) {
    auto tree = std::make_unique<octomap::OcTree>(0.1);
    if (!tree->readBinary(in)) return nullptr;
    return tree;
  }
  return std::unique_ptr<octomap::AbstractOcTree>(octomap::AbstractOcTree::read(in));
}

/// Leaf by leaf: key, depth, log-odds. @return number of leaves, or nothing if one differs.
template <class Tree>
std::optional<std::uint64_t> same_leaves(const Tree& a, const Tree& b) {
  auto i = a.begin_leafs();
  auto j = b.begin_leafs();
  std::uint64_t count = 0;
  for (; i != a.end_leafs() && j != b.end_leafs(); ++i, ++j, ++count) {
    if (i.getKey() != j.getKey() || i.getDepth() != j.getDepth() || !(*i == *j)) return std::nullopt;
  }
  if (i != a.end_leafs() || j != b.end_leafs()) return std::nullopt;
  return count;
}
std::optional<std::uint64_t> same_trees(const octomap::AbstractOcTree* a, const octomap::AbstractOcTree* b) {
  if (const auto* x = dynamic_cast<const octomap::ColorOcTree*>(a)) {
    const auto* y = dynamic_cast<const octomap::ColorOcTree*>(b);
    return y == nullptr ? std::nullopt : same_leaves(*x, *y);
  }
  const auto* x = dynamic_cast<const octomap::OcTree*>(a);
  const auto* y = dynamic_cast<const octomap::OcTree*>(b);
  return x == nullptr || y == nullptr ? std::nullopt : same_leaves(*x, *y);
}

octomap::Pointcloud occupied_centers(const OccupancyTree& tree, double resolution_m) {
  octomap::Pointcloud cloud;
  const auto points = occupancy_points({{0, 0, 0, kOccupancyHeight}, to_binary(tree)},
                                       occupancy_schema(OccupancyKind::binary, resolution_m));
  for (std::size_t i = 0; points.ok() && i < points->size(); ++i) {
    const Vec3& p = points->xyz[i];
    if (points->channels[0].get<std::uint8_t>(i) != 0) cloud.push_back(float(p[0]), float(p[1]), float(p[2]));
  }
  return cloud;
}

octomap::point3d middle_of(const octomap::Pointcloud& cloud) {
  octomap::point3d low, high;
  cloud.calcBBX(low, high);
  return (low + high) * 0.5F;
}

/// scan.dat(.bz2) of OctoMap: lines of x y z, seen from the origin.
octomap::Pointcloud read_scan(const std::string& path) {
  octomap::Pointcloud cloud;
  const bool packed = fs::path(path).extension() == ".bz2";
  FILE* const in =
      packed ? ::popen(("bzip2 -dc '" + path + "'").c_str(), "r") : std::fopen(path.c_str(), "r");
  if (in == nullptr) return cloud;
  float x = 0, y = 0, z = 0;
  while (std::fscanf(in, "%f %f %f", &x, &y, &z) == 3) cloud.push_back(x, y, z);
  packed ? ::pclose(in) : std::fclose(in);
  return cloud;
}

struct Times {
  double encode = 1e9, decode = 1e9, read = 1e9, build = 1e9;
};

class OctomapBench {
 public:
  OctomapBench(const BenchSettings& settings, bench::Report& report) : settings_(settings), report_(report) {}

  Status file(const std::string& path) {
    const std::string text = slurp(path);
    MAPCODEC_ASSIGN(const OctreeFile file, parse_octree(bytes_of(text)));
    octomap::Pointcloud hits = occupied_centers(file.tree, file.resolution_m);
    const octomap::point3d eye = hits.size() > 0 ? middle_of(hits) : octomap::point3d();
    return measure(fs::path(path).filename().string(), text, file, hits, eye, "occupied centres");
  }

  /// The tree that OctoMap builds of a scan.
  Status scan(const std::string& path, const octomap::Pointcloud& cloud, double resolution_m) {
    octomap::OcTree tree(resolution_m);
    tree.insertPointCloud(cloud, octomap::point3d(0, 0, 0));
    tree.toMaxLikelihood();
    tree.prune();
    MAPCODEC_ASSIGN(const OctreeFile built, from_octomap(tree));
    OctreeFile file;
    file.tree = to_binary(built.tree);
    file.resolution_m = resolution_m;
    const Bytes bytes = format_octree(file.tree, resolution_m, OctreeFormat::bt);
    return measure(fs::path(path).filename().string() + fmt::format(" at {} m", resolution_m),
                   std::string(bytes.begin(), bytes.end()), file, cloud, octomap::point3d(0, 0, 0),
                   "its scan");
  }

  /// One box of ten metres out of a map of many scans.
  Status box(const octomap::Pointcloud& cloud) {
    settings_.say("a box out of a large map");
    const int side = settings_.quick ? 2 : 5;
    octomap::OcTree tree(0.05);
    for (int i = 0; i < side * side; ++i) {
      octomap::Pointcloud moved(cloud);
      const octomap::point3d at(float(i % side) * 20.0F, float(i / side) * 20.0F, 0);
      moved.transform(octomap::pose6d(at, octomath::Quaternion(0, 0, 0.3 * i)));
      tree.insertPointCloud(moved, at, -1, true, true);
    }
    tree.updateInnerOccupancy();
    tree.toMaxLikelihood();
    tree.prune();
    MAPCODEC_ASSIGN(const OctreeFile built, from_octomap(tree));
    const OccupancyTree binary = to_binary(built.tree);
    const Bytes bt = format_octree(binary, 0.05, OctreeFormat::bt);
    const std::string text(bt.begin(), bt.end());
    OccupancyWrite write;
    write.overwrite = true;
    MAPCODEC_TRY(create_occupancy_map(report_.scratch(), binary, 0.05, write));
    Region region;
    region.box = Box{{15, 15, -5}, {25, 25, 5}};
    double seconds = 1e9, whole = 1e9;
    std::uint64_t bytes = 0, tiles = 0, leaves = 0, all_tiles = 0;
    for (int k = 0; k < kRepeats; ++k) {
      const double begin = cpu_seconds();
      MAPCODEC_ASSIGN(const OccupancyMap map, OccupancyMap::open(report_.scratch()));
      MAPCODEC_ASSIGN(const auto part, read_octomap(map, region));
      seconds = std::min(seconds, cpu_seconds() - begin);
      bytes = map.file().archive().bytes_read();
      tiles = map.tiles_in(region).size();
      all_tiles = map.file().archive().tiles().size();
      leaves = part == nullptr ? 0 : part->getNumLeafNodes();
      whole = std::min(whole, seconds_of([&] { (void)octomap_read(text); }));
    }
    Json j{{"bt_bytes", text.size()},      {"archive_bytes", fs::file_size(report_.scratch())},
           {"bytes_read", bytes},          {"tiles_read", tiles},
           {"tiles", all_tiles},           {"leaves", binary.leaf_count()},
           {"box_leaves", leaves},         {"box_seconds", seconds},
           {"octomap_read_seconds", whole}};
    report_.json()["box"] = j;
    report_.line("");
    report_.line(
        fmt::format("A box of 10 m out of {} leaves ({} bytes of .bt, {} of archive): {} bytes read, {} of "
                    "{} tiles, {} leaves, "
                    "{} ms as an octomap::OcTree; OctoMap reads the whole .bt in {} ms.",
                    binary.leaf_count(), text.size(), fs::file_size(report_.scratch()), bytes, tiles,
                    all_tiles, leaves, digits(1e3 * seconds), digits(1e3 * whole)));
    settings_.print(j.dump());
    return {};
  }

 private:
  Status measure(const std::string& name, const std::string& text, const OctreeFile& file,
                 const octomap::Pointcloud& hits, const octomap::point3d& eye, const char* built_of) {
    settings_.say(name);
    OccupancyWrite write;
    write.overwrite = true;
    write.input_bytes = text.size();
    MAPCODEC_TRY(create_occupancy_map(report_.scratch(), file.tree, file.resolution_m, write));
    MAPCODEC_ASSIGN(const OccupancyMap map, OccupancyMap::open(report_.scratch()));
    MAPCODEC_ASSIGN(const OccupancyTree back, map.read());
    const auto format = file.tree.kind == OccupancyKind::binary ? OctreeFormat::bt : OctreeFormat::ot;
    const Bytes again = format_octree(back, map.resolution_m(), format);
    const auto leaves =
        same_trees(octomap_read(text).get(), octomap_read(std::string(again.begin(), again.end())).get());
    if (!leaves) return make_error(ErrorCode::kPromiseBroken, name + ": leaves differ");
    const Times t = times(text, file, hits, eye);
    const std::uint64_t bytes = fs::file_size(report_.scratch()), packed = zstd_bytes(text);
    report_.json()["trees"].push_back({{"name", name},
                                       {"kind", occupancy_name(file.tree.kind)},
                                       {"leaves", *leaves},
                                       {"tiles", map.file().archive().tiles().size()},
                                       {"file_bytes", text.size()},
                                       {"zstd19_bytes", packed},
                                       {"archive_bytes", bytes},
                                       {"to_zstd", double(bytes) / double(packed)},
                                       {"encode_seconds", t.encode},
                                       {"decode_seconds", t.decode},
                                       {"octomap_read_seconds", t.read},
                                       {"octomap_build_seconds", t.build},
                                       {"built_of", built_of}});
    report_.row({name, std::to_string(*leaves), std::to_string(text.size()), std::to_string(packed),
                 std::to_string(bytes), digits(double(bytes) / double(packed)), digits(1e3 * t.encode),
                 digits(1e3 * t.decode), digits(t.decode / t.read), digits(t.build / t.encode),
                 digits(t.build / t.decode), built_of});
    settings_.print(fmt::format(
        "{}: {} bytes, {:.3f} x zstd; decode {:.2f} x OctoMap's read; build / encode {:.1f}, / decode {:.1f}",
        name, bytes, double(bytes) / double(packed), t.decode / t.read, t.build / t.encode,
        t.build / t.decode));
    return {};
  }

  /// Best of some, ours and OctoMap's in turns.
  static Times times(const std::string& text, const OctreeFile& file, const octomap::Pointcloud& hits,
                     const octomap::point3d& eye) {
    Times t;
    for (int k = 0; k < kRepeats; ++k) {
      std::vector<Bytes> tiles;
      std::vector<OccupancyExtra> extras;
      t.encode = std::min(t.encode, seconds_of([&] {
                            for (const OccupancyPiece& p : cut_tree(file.tree, kOccupancyTileNodes, extras))
                              tiles.push_back(encode_occupancy_tile(p, file.resolution_m).bytes);
                          }));
      t.decode = std::min(t.decode, seconds_of([&] {
                            std::vector<OccupancyPiece> pieces;
                            for (const Bytes& b : tiles) pieces.push_back(decode_occupancy_tile(b).value());
                            (void)join_pieces(pieces, extras).ok();
                          }));
      t.read = std::min(t.read, seconds_of([&] { (void)octomap_read(text); }));
      if (k > 1) continue;
      t.build = std::min(t.build, seconds_of([&] {
                           octomap::OcTree tree(file.resolution_m);
                           tree.insertPointCloud(hits, eye);
                         }));
    }
    return t;
  }

  const BenchSettings& settings_;
  bench::Report& report_;
};

std::vector<std::string> files_of(const BenchSettings& settings, const std::vector<std::string>& endings) {
  std::vector<std::string> found;
  std::error_code ignored;
  for (const auto& entry : fs::recursive_directory_iterator(settings.data, ignored)) {
    const std::string path = entry.path().string();
    const bool fits =
        std::any_of(endings.begin(), endings.end(), [&](const auto& e) { return path.ends_with(e); });
    const bool asked = settings.files.empty() ||
                       std::any_of(settings.files.begin(), settings.files.end(),
                                   [&](const auto& f) { return path.find(f) != std::string::npos; });
    if (fits && asked) found.push_back(path);
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

Status bench_octomap(const BenchSettings& settings) {
  const std::vector<std::string> trees = files_of(settings, {".bt", ".ot"});
  const std::vector<std::string> scans = files_of(settings, {"scan.dat.bz2", "scan.dat"});
  if (trees.empty() && scans.empty()) return make_error(ErrorCode::kEmpty, "holds no .bt, .ot or scan.dat");
  bench::Report report(settings, "octomap", 1);
  MAPCODEC_TRY(report.begin());
  report.table({"tree", "leaves", "file bytes", "zstd -19", "archive", "to zstd", "encode ms", "decode ms",
                "decode / OctoMap's read", "build / encode", "build / decode", "built of"});
  OctomapBench bench(settings, report);
  for (const std::string& path : trees) MAPCODEC_TRY(bench.file(path));
  for (const std::string& path : scans) {
    const octomap::Pointcloud cloud = read_scan(path);
    if (cloud.size() == 0) continue;
    for (const double resolution_m : {0.08, 0.05}) MAPCODEC_TRY(bench.scan(path, cloud, resolution_m));
    MAPCODEC_TRY(bench.box(cloud));
  }
  std::error_code ignored;
  fs::remove(report.scratch(), ignored);
  return report.finish();
}

}  // namespace mapcodec
