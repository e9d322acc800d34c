// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/autoware/autoware_folder.hpp"

#include <filesystem>

#include "slam_adapter/autoware/autoware_metadata.hpp"
#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMostText = std::uint64_t{64} << 20;

Result<AutowareMetadata> read_metadata(const std::string& path) {
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  if ((*stream)->size() > kMostText)
    return named(path, make_error(ErrorCode::kLimitExceeded, "is larger than 64 MiB"));
  std::string text((*stream)->size(), '\0');
  auto got = (*stream)->read_at(0, reinterpret_cast<std::uint8_t*>(text.data()), text.size());
  if (!got.ok()) return named(path, got.error());
  text.resize(*got);
  auto metadata = parse_autoware_metadata(text);
  if (!metadata.ok()) return named(path, metadata.error());
  return metadata;
}

Result<std::string> find_tile(const std::string& folder, const std::string& file) {
  std::error_code ignored;
  for (const char* place : {"", kAutowareTileFolder, "pointcloud_map"}) {
    const fs::path path = fs::path(folder) / place / file;
    if (fs::is_regular_file(path, ignored)) return path.string();
  }
  return make_error(ErrorCode::kNotFound, folder + ": the tile " + file + ", which " + kAutowareMetadataFile +
                                              " names, is not there");
}

Result<std::vector<std::string>> find_tiles(const std::string& folder) {
  MAPCODEC_ASSIGN(const AutowareMetadata metadata,
                  read_metadata((fs::path(folder) / kAutowareMetadataFile).string()));
  std::vector<std::string> paths;
  for (const auto& tile : metadata.tiles) {
    MAPCODEC_ASSIGN(std::string path, find_tile(folder, tile.file));
    paths.push_back(std::move(path));
  }
  return paths;
}

bool same_channels(const PointCloud& a, const PointCloud& b) {
  if (a.channels.size() != b.channels.size()) return false;
  for (const Channel& c : a.channels) {
    const Channel* other = b.find(c.info.name);
    if (other == nullptr || other->info != c.info) return false;
  }
  return true;
}

/// Opens its files one after the other: a map may have more tiles than a process may have files.
class TileFiles final : public NamedSource {
 public:
  TileFiles(const std::string& folder, std::vector<std::string> paths, const ReadOptions& options)
      : NamedSource(folder), paths_(std::move(paths)), options_(options) {}

  Status look() {
    for (const std::string& path : paths_) {
      auto source = open_source(path, options_);
      if (!source.ok() && source.error().code == ErrorCode::kEmpty) continue;
      if (!source.ok()) return source.error();
      const PointCloud& layout = (*source)->layout();
      if (!known_) layout_ = layout.like();
      known_ = true;
      if (!same_channels(layout_, layout))
        return make_error(
            ErrorCode::kInvalidArgument,
            path + ": has other channels than the tiles before; tiles of one map need the same");
      if (layout.coordinates != layout_.coordinates)
        layout_.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
      announced_ += (*source)->announced_points().value_or(0);
    }
    if (known_) return {};
    return make_error(ErrorCode::kEmpty, name() + ": holds no point");
  }

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return announced_; }
  [[nodiscard]] std::uint64_t dropped_points() const override {
    return dropped_ + (source_ ? source_->dropped_points() : 0);
  }
  [[nodiscard]] std::vector<std::string> warnings() const override { return warnings_; }

  Result<bool> next(PointCloud& block) override {
    block = layout_.like();
    while (status_.ok()) {
      if (!source_ && at_ == paths_.size()) return false;
      if (!source_) open(paths_[at_]);
      if (!source_) continue;
      auto more = source_->next(part_);
      if (!more.ok()) status_ = more.error();
      if (!more.ok()) break;
      if (*more) return give(block);
      close();
    }
    return status_.error();
  }
  Status rewind() override {
    source_.reset();
    at_ = 0;
    dropped_ = 0;
    status_ = {};
    return {};
  }

 private:
  void open(const std::string& path) {
    auto source = open_source(path, options_);
    if (source.ok())
      source_ = std::move(source).value();
    else if (source.error().code == ErrorCode::kEmpty)
      ++at_;
    else
      status_ = source.error();
  }
  void close() {
    dropped_ += source_->dropped_points();
    // A thousand tiles say the same; a few are enough.
    for (std::string& w : source_->warnings()) {
      if (warnings_.size() < 10) warnings_.push_back(std::move(w));
    }
    source_.reset();
    ++at_;
  }
  bool give(PointCloud& block) {
    block.xyz.swap(part_.xyz);
    for (Channel& c : block.channels) c.data.swap(part_.find(c.info.name)->data);
    return true;
  }

  std::vector<std::string> paths_;
  ReadOptions options_;
  PointCloud layout_, part_;
  bool known_ = false;
  std::uint64_t announced_ = 0, dropped_ = 0;
  std::size_t at_ = 0;
  std::unique_ptr<PointSource> source_;
  std::vector<std::string> warnings_;
  Status status_;
};

}  // namespace

bool is_autoware_folder(const std::string& folder) {
  std::error_code ignored;
  return fs::is_regular_file(fs::path(folder) / kAutowareMetadataFile, ignored);
}

Result<std::unique_ptr<PointSource>> open_autoware_folder(const std::string& folder,
                                                          const ReadOptions& options) {
  MAPCODEC_ASSIGN(std::vector<std::string> paths, find_tiles(folder));
  auto source = std::make_unique<TileFiles>(folder, std::move(paths), options);
  MAPCODEC_TRY(source->look());
  return std::unique_ptr<PointSource>(std::move(source));
}

Result<std::uint64_t> autoware_folder_bytes(const std::string& folder) {
  MAPCODEC_ASSIGN(const std::vector<std::string> paths, find_tiles(folder));
  std::uint64_t sum = 0;
  for (const std::string& path : paths) {
    MAPCODEC_ASSIGN(const std::uint64_t bytes, input_bytes(path));
    sum += bytes;
  }
  return sum;
}

}  // namespace mapcodec
