// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/clouds.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "slam_adapter/formats/formats.hpp"

namespace mapcodec::bench {
namespace {

namespace fs = std::filesystem;

bool is_wanted(const std::string& path, const std::vector<std::string>& parts) {
  return parts.empty() || std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
           return path.find(part) != std::string::npos;
         });
}

std::string plain_name(const std::string& path) {
  std::string name = fs::path(path).stem().string();
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_') c = '_';
  }
  return name;
}

Result<std::unique_ptr<PointSource>> open_in_metres(const std::string& path) {
  ReadOptions options;
  const Result<std::string> format = detect_format(path);
  if (format.ok() && *format == "3DTK") options.unit_m = 0.01;
  return open_source(path, options);
}

}  // namespace

Result<std::vector<std::string>> find_clouds(const BenchSettings& settings) {
  std::error_code failed;
  fs::recursive_directory_iterator it(settings.data, failed);
  if (failed) return make_error(ErrorCode::kNotFound, settings.data + ": " + failed.message());
  std::vector<std::string> paths;
  for (const fs::directory_entry& entry : it) {
    const std::string path = entry.path().string();
    if (entry.is_regular_file(failed) && is_wanted(path, settings.files) && open_in_metres(path).ok()) {
      paths.push_back(path);
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

Result<BenchCloud> load_cloud(const std::string& path) {
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_in_metres(path));
  BenchCloud r{path, plain_name(path), source->layout().like()};
  for (PointCloud block;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) return r;
    r.cloud.append(block);
  }
}

bool is_camera_frame(const PointCloud& cloud) {
  // Some drivers look along z, some against it.
  std::size_t before = 0, behind = 0;
  for (const Vec3& p : cloud.xyz) {
    const double depth = std::abs(p[2]);
    const bool seen =
        depth > 0.2 && depth < 15 && std::abs(p[0]) < 0.8 * depth && std::abs(p[1]) < 0.7 * depth;
    before += seen && p[2] > 0 ? 1U : 0U;
    behind += seen && p[2] < 0 ? 1U : 0U;
  }
  return static_cast<double>(std::max(before, behind)) > 0.95 * static_cast<double>(cloud.size());
}

}  // namespace mapcodec::bench
