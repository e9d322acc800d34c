// SPDX-License-Identifier: GPL-3.0-or-later
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>

#include "maps/submap_pose.hpp"
#include "slam_adapter/autoware/autoware_folder.hpp"
#include "slam_adapter/autoware/autoware_metadata.hpp"
#include "slam_adapter/formats/file_sink.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kAtOnce = 8'000'000;  ///< points of tiles that may be held

/// A column of space by its whole number of tile sides along x and y.
using Cell = std::pair<std::int64_t, std::int64_t>;
struct Cells {
  Cell min, max;  ///< max is not in it
};

/// Written under another name until it is complete.
class NewFolder {
 public:
  explicit NewFolder(const std::string& path)
      : path_(path), temporary_(path + ".tmp" + std::to_string(::getpid())) {}
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  ~NewFolder() {
    std::error_code ignored;
    fs::remove_all(temporary_, ignored);
  }
  Status begin(bool overwrite) {
    std::error_code failed;
    if (fs::exists(path_, failed)) {
      if (!overwrite) return cannot("exists already (--force replaces it)");
      if (!is_autoware_folder(path_))
        return cannot("exists already and is no Autoware map, so it is not replaced");
      replaces_ = true;
    }
    fs::create_directories(fs::path(temporary_) / kAutowareTileFolder, failed);
    return failed ? cannot("cannot be made: " + failed.message()) : Status{};
  }
  Status commit() {
    std::error_code failed;
    const std::string old = temporary_ + ".old";
    if (replaces_) fs::rename(path_, old, failed);
    if (!failed) fs::rename(temporary_, path_, failed);
    if (failed) return cannot("cannot be renamed: " + failed.message());
    std::error_code ignored;
    if (replaces_) fs::remove_all(old, ignored);
    return {};
  }
  [[nodiscard]] std::string tile(const std::string& file) const {
    return (fs::path(temporary_) / kAutowareTileFolder / file).string();
  }
  [[nodiscard]] std::string metadata() const {
    return (fs::path(temporary_) / kAutowareMetadataFile).string();
  }

 private:
  [[nodiscard]] Error cannot(const std::string& what) const {
    return make_error(ErrorCode::kCannotWrite, path_ + ": " + what);
  }
  std::string path_, temporary_;
  bool replaces_ = false;
};

class Exporter {
 public:
  Exporter(const MapFile& map, const Region& region, const ReadSettings& settings,
           const AutowareExport& options, NewFolder& folder, AutowareReport& report)
      : map_(map), region_(region), settings_(settings), options_(options), folder_(folder), report_(report) {
    layout_ = map.layout(settings).like();
    layout_.coordinates = {};
    std::erase_if(layout_.channels, [](const Channel& c) { return c.info.name == kOrderChannel; });
    metadata_.x_resolution_m = metadata_.y_resolution_m = options.tile_size_m;
  }

  Status run() {
    Box bounds;
    for (const std::size_t i : map_.tiles_in(region_)) {
      const TileRecord& tile = map_.archive().tiles()[i];
      bounds.add(pose_of(map_.archive().info(), tile.submap).apply(tile.bounds));
    }
    if (!bounds.empty()) {
      const Cell low = cell_of(bounds.min), high = cell_of(bounds.max);
      // One more on each side: decoded points may lie a hair beyond.
      MAPCODEC_TRY(write({{low.first - 1, low.second - 1}, {high.first + 2, high.second + 2}}));
    }
    if (metadata_.tiles.empty()) return make_error(ErrorCode::kEmpty, "no point lies in the asked region");
    warn();
    OutputFile file;
    MAPCODEC_TRY(file.open(folder_.metadata()));
    MAPCODEC_TRY(file.append(format_autoware_metadata(metadata_)));
    return file.commit();
  }

 private:
  [[nodiscard]] Cell cell_of(const Vec3& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] / options_.tile_size_m)),
            static_cast<std::int64_t>(std::floor(p[1] / options_.tile_size_m))};
  }
  [[nodiscard]] static bool holds(const Cells& cells, const Cell& c) {
    return c.first >= cells.min.first && c.first < cells.max.first && c.second >= cells.min.second &&
           c.second < cells.max.second;
  }
  [[nodiscard]] Region region_of(const Cells& cells) const {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    const double s = options_.tile_size_m;
    Box b;
    b.min = {static_cast<double>(cells.min.first) * s, static_cast<double>(cells.min.second) * s, -kInf};
    b.max = {static_cast<double>(cells.max.first) * s, static_cast<double>(cells.max.second) * s, kInf};
    Region r = region_;
    if (region_.box) {
      for (std::size_t d = 0; d < 3; ++d) {
        b.min[d] = std::max(b.min[d], region_.box->min[d]);
        b.max[d] = std::min(b.max[d], region_.box->max[d]);
      }
    }
    r.box = b;
    return r;
  }

  /// Halves what holds too much, until it can be read at once.
  Status write(const Cells& cells) {
    const Region region = region_of(cells);
    std::uint64_t points = 0;
    for (const std::size_t i : map_.tiles_in(region)) points += map_.archive().tiles()[i].points;
    if (points == 0) return {};
    const std::int64_t width = cells.max.first - cells.min.first,
                       height = cells.max.second - cells.min.second;
    if (points <= kAtOnce) return write_at_once(cells, region);
    if (width == 1 && height == 1) return write_large(cells.min, region);
    Cells low = cells, high = cells;
    if (width >= height)
      low.max.first = high.min.first = cells.min.first + width / 2;
    else
      low.max.second = high.min.second = cells.min.second + height / 2;
    MAPCODEC_TRY(write(low));
    return write(high);
  }

  /// The points of a tile of the archive, laid out as the files are, that lie in `cells`.
  Status spread(const Cells& cells, PointCloud&& cloud,
                const std::function<Status(const Cell&, const PointCloud&, std::size_t)>& take) const {
    std::erase_if(cloud.channels, [](const Channel& c) { return c.info.name == kOrderChannel; });
    cloud.coordinates = layout_.coordinates;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      // Points that are not finite have no place in a map of tiles.
      if (!is_finite(cloud.xyz[i])) continue;
      const Cell c = cell_of(cloud.xyz[i]);
      if (holds(cells, c)) MAPCODEC_TRY(take(c, cloud, i));
    }
    return {};
  }

  Status write_at_once(const Cells& cells, const Region& region) {
    std::map<Cell, PointCloud> tiles;
    MAPCODEC_TRY(map_.read(region, settings_, [&](PointCloud&& cloud) {
      return spread(cells, std::move(cloud), [&](const Cell& c, const PointCloud& from, std::size_t i) {
        PointCloud& to = tiles.try_emplace(c, layout_).first->second;
        to.append(from, i, i + 1);
        return Status{};
      });
    }));
    for (const auto& [cell, cloud] : tiles) {
      MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, begin_tile(cell, cloud.size()));
      see(cloud);
      MAPCODEC_TRY(sink->write(cloud));
      MAPCODEC_TRY(sink->finish());
    }
    return {};
  }

  /// One tile that holds more than may be held: counted first, then written as it is decoded.
  Status write_large(const Cell& cell, const Region& region) {
    const Cells cells{cell, {cell.first + 1, cell.second + 1}};
    std::uint64_t count = 0;
    MAPCODEC_TRY(map_.read(region, settings_, [&](PointCloud&& cloud) {
      return spread(cells, std::move(cloud), [&](const Cell&, const PointCloud&, std::size_t) {
        ++count;
        return Status{};
      });
    }));
    if (count == 0) return {};
    MAPCODEC_ASSIGN(const std::unique_ptr<PointSink> sink, begin_tile(cell, count));
    MAPCODEC_TRY(map_.read(region, settings_,
                           [&](PointCloud&& cloud) { return write_part(cells, std::move(cloud), *sink); }));
    return sink->finish();
  }

  Status write_part(const Cells& cells, PointCloud&& cloud, PointSink& sink) {
    PointCloud part = layout_;
    MAPCODEC_TRY(spread(cells, std::move(cloud), [&](const Cell&, const PointCloud& from, std::size_t i) {
      part.append(from, i, i + 1);
      return Status{};
    }));
    see(part);
    return part.empty() ? Status{} : sink.write(part);
  }

  Result<std::unique_ptr<PointSink>> begin_tile(const Cell& cell, std::uint64_t points) {
    const double x = static_cast<double>(cell.first) * options_.tile_size_m;
    const double y = static_cast<double>(cell.second) * options_.tile_size_m;
    char name[64];
    std::snprintf(name, sizeof(name), "%.0f_%.0f.pcd", x, y);
    metadata_.tiles.push_back({name, x, y});
    report_.points += points;
    ++report_.tiles;
    return open_sink(folder_.tile(name), layout_, points, options_.write);
  }

  void see(const PointCloud& cloud) {
    for (const Vec3& p : cloud.xyz) {
      for (const double v : p) largest_ = std::max(largest_, std::fabs(v));
    }
  }

  void warn() {
    const auto top = static_cast<float>(largest_);
    const double step = double(std::nextafter(top, INFINITY)) - double(top);
    if (step > 1e-3) {
      char text[160];
      std::snprintf(text, sizeof(text),
                    "coordinates reach %.0f: the float32 of Autoware's tiles keeps them within %.2g m only",
                    largest_, step / 2);
      report_.warnings.emplace_back(text);
    }
    for (std::string& w : unwritten_channels("tile.pcd", layout_)) report_.warnings.push_back(std::move(w));
  }

  const MapFile& map_;
  const Region& region_;
  const ReadSettings& settings_;
  const AutowareExport& options_;
  NewFolder& folder_;
  AutowareReport& report_;
  PointCloud layout_;
  AutowareMetadata metadata_;
  double largest_ = 0;
};

}  // namespace

Result<AutowareReport> export_autoware(const std::string& map_path, const std::string& folder,
                                       const Region& region, std::optional<std::uint64_t> revision,
                                       const ReadSettings& settings, const AutowareExport& options) {
  const auto begin = std::chrono::steady_clock::now();
  const double size = options.tile_size_m;
  if (!(size >= 1) || size != std::floor(size) || size > 1e6)
    return make_error(
        ErrorCode::kInvalidArgument,
        "tiles of Autoware have sides of whole metres, 1 to 1000000: its loader reads integers");
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  NewFolder place(folder);
  MAPCODEC_TRY(place.begin(options.overwrite));
  AutowareReport report;
  MAPCODEC_TRY(Exporter(map, region, settings, options, place, report).run());
  MAPCODEC_TRY(place.commit());
  report.tiles_read = map.tiles_in(region).size();
  report.bytes_read = map.archive().bytes_read();
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return report;
}

}  // namespace mapcodec
