// SPDX-License-Identifier: GPL-3.0-or-later
// A program outside the tree: writes a map, opens it, reads a box. README.md quotes the part between the
// marks. Usage: consumer MAP.mapc
#include <cstdio>
#include <mapcodec/mapcodec.hpp>

// README begin
/// Compresses `cloud` so that no point moves more than 2 mm along an axis, then reads one cubic metre of it.
mapcodec::Result<std::size_t> points_in_box(const mapcodec::PointCloud& cloud, const std::string& path) {
  mapcodec::CompressOptions options;
  options.promise = mapcodec::PromiseKind::max_error;
  options.promise_m = 0.002;
  options.overwrite = true;
  if (auto report = mapcodec::write_map(cloud, path, options); !report.ok()) return report.error();

  auto map = mapcodec::MapFile::open(path);
  if (!map.ok()) return map.error();
  mapcodec::Region region;
  region.box = mapcodec::Box{{0, 0, 0}, {1, 1, 1}};
  auto part = map->read(region);  // decodes only the tiles that meet the box
  if (!part.ok()) return part.error();
  return part->size();
}
// README end

int main(int argc, char** argv) {
  mapcodec::PointCloud cloud;
  for (int i = 0; i < 9000; ++i) {  // a floor of 3 m x 3 m at a height of 0.5 m
    cloud.xyz.push_back({0.02 + 0.031 * (i % 96), 0.02 + 0.031 * (i / 96), 0.5});
  }
  const auto count = points_in_box(cloud, argc > 1 ? argv[1] : "map.mapc");
  if (!count.ok()) {
    std::fprintf(stderr, "%s\n", count.error().to_string().c_str());
    return 1;
  }
  std::printf("%zu of %zu points lie in the box\n", *count, cloud.size());
  return *count == 32u * 32u ? 0 : 1;
}
