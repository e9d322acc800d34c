// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/map_registry.hpp"

#include <algorithm>
#include <filesystem>

#include "maps/map_writer.hpp"
#include "maps/stale_files.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;

constexpr const char* kExtension = ".mapc";
constexpr const char* kUploadPrefix = ".upload-";  // no name of a map begins so

/// Opening for writing cuts off what a killed writer left. A map that cannot be opened stays as it is: its
/// readers are told why.
void repair_tail(const std::string& path) {
  remove_stale_temporaries(path);
  const auto archive = MapArchive::open(path);
  if (archive.ok() && archive->trailing_bytes() > 0) (void)MapWriter::open(path).ok();
}

}  // namespace

bool is_map_name(const std::string& name) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  if (name.empty() || name.size() > 100 || !is_plain(name.front())) return false;
  return std::all_of(name.begin(), name.end(), [&](char c) { return is_plain(c) || c == '-' || c == '.'; });
}

Status MapRegistry::scan_folder() {
  std::error_code error;
  const fs::path folder(context_.settings.folder);
  if (!fs::is_directory(folder, error))
    return make_error(ErrorCode::kNotFound, folder.string() + ": is no folder");
  fs::directory_iterator files(folder, error);
  if (error) return make_error(ErrorCode::kUnreadable, folder.string() + ": " + error.message());
  for (; files != fs::directory_iterator(); files.increment(error)) {
    if (error) return make_error(ErrorCode::kUnreadable, folder.string() + ": " + error.message());
    const std::string name = files->path().stem().string();
    if (name.rfind(kUploadPrefix, 0) == 0) {
      std::error_code ignored;
      fs::remove(files->path(), ignored);
      continue;
    }
    if (files->path().extension() != kExtension || !is_map_name(name)) continue;
    repair_tail(files->path().string());
    const std::unique_lock lock(mutex_);
    maps_.emplace(name, std::make_shared<HostedMap>(name, files->path().string(), context_));
  }
  return {};
}

Result<HostedMapPtr> MapRegistry::find(const std::string& name) const {
  if (!is_map_name(name))
    return make_error(
        ErrorCode::kInvalidArgument,
        "a map's name has 1 to 100 letters, digits, '-', '_' and '.', and begins with none of the "
        "last and no '-'");
  const std::shared_lock lock(mutex_);
  const auto at = maps_.find(name);
  if (at == maps_.end()) return make_error(ErrorCode::kNotFound, "there is no map '" + name + "'");
  return at->second;
}

std::vector<HostedMapPtr> MapRegistry::all() const {
  const std::shared_lock lock(mutex_);
  std::vector<HostedMapPtr> maps;
  for (const auto& [name, map] : maps_) maps.push_back(map);
  return maps;
}

std::size_t MapRegistry::size() const {
  const std::shared_lock lock(mutex_);
  return maps_.size();
}

std::string MapRegistry::path_of(const std::string& name) const {
  return (fs::path(context_.settings.folder) / (name + kExtension)).string();
}

Result<MapRegistry::Claim> MapRegistry::claim(const std::string& name) {
  const auto found = find(name);
  if (!found.ok() && found.error().code == ErrorCode::kInvalidArgument) return found.error();
  const std::unique_lock lock(mutex_);
  if (maps_.contains(name) || claimed_.contains(name))
    return make_error(ErrorCode::kExists, "there is a map '" + name + "' already");
  if (maps_.size() + claimed_.size() >= context_.settings.max_maps)
    return make_error(ErrorCode::kLimitExceeded, "there are as many maps as the service may hold");
  claimed_.insert(name);
  return Claim(*this, name);
}

MapRegistry::Claim::~Claim() {
  if (registry_ == nullptr) return;
  const std::unique_lock lock(registry_->mutex_);
  registry_->claimed_.erase(name_);
}

void MapRegistry::Claim::keep() {
  const std::unique_lock lock(registry_->mutex_);
  registry_->maps_.emplace(
      name_, std::make_shared<HostedMap>(name_, registry_->path_of(name_), registry_->context_));
}

Result<HostedMapPtr> MapRegistry::take_out(const std::string& name) {
  MAPCODEC_ASSIGN(HostedMapPtr map, find(name));
  const std::unique_lock lock(mutex_);
  if (maps_.erase(name) == 0) return make_error(ErrorCode::kNotFound, "there is no map '" + name + "'");
  return map;
}

void MapRegistry::clear() {
  const std::unique_lock lock(mutex_);
  maps_.clear();
}

}  // namespace mapcodec
