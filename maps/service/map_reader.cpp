// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/map_reader.hpp"

#include <sys/stat.h>

#include "maps/file_store.hpp"

namespace mapcodec {
namespace {

constexpr auto kKeepReplaced = std::chrono::minutes(2);
constexpr std::size_t kKeepFiles = 4, kKeepRevisions = 4;

}  // namespace

MapReader::Look MapReader::look() const {
  struct stat s {};
  if (::stat(path_.c_str(), &s) != 0) return {};
  return {std::uint64_t(s.st_ino), std::uint64_t(s.st_size),
          std::int64_t(s.st_mtim.tv_sec) * 1000000000 + s.st_mtim.tv_nsec};
}

Result<MapViewPtr> MapReader::open() {
  // The file may be replaced between the two looks: then once more.
  for (;;) {
    const Look before = look();
    auto archive = MapArchive::open(path_);
    const Look after = look();
    if (before.inode != after.inode) continue;
    if (!archive.ok()) return archive.error();
    auto view = std::make_shared<MapView>();
    view->name = name_;
    MAPCODEC_ASSIGN(view->schema, read_schema(archive->info().schema));
    view->archive = std::make_shared<const MapArchive>(std::move(archive).value());
    const bool same_file = view_ != nullptr && before.inode == seen_.inode;
    view->file = same_file ? view_->file : context_.next_file++;
    seen_ = before;
    return MapViewPtr(std::move(view));
  }
}

Result<MapViewPtr> MapReader::newest(bool own_writer) {
  const std::lock_guard lock(mutex_);
  if (closed_) return make_error(ErrorCode::kNotFound, "there is no map '" + name_ + "'");
  if (view_ != nullptr && !changed_ && (own_writer || look() == seen_)) return view_;
  changed_ = false;  // before looking: what changes from here on is seen next time
  MAPCODEC_ASSIGN(MapViewPtr opened, open());
  if (view_ != nullptr && view_->file != opened->file) {
    replaced_.push_back({view_, std::chrono::steady_clock::now()});
    if (replaced_.size() > kKeepFiles) replaced_.pop_front();
    revisions_.clear();
  }
  view_ = std::move(opened);
  return view_;
}

Result<MapViewPtr> MapReader::at(const MapViewPtr& newest, const std::string& revision) {
  if (revision.empty()) return newest;
  MAPCODEC_ASSIGN(const std::uint64_t number, newest->archive->resolve(revision));
  if (number == newest->archive->revision()) return newest;
  const std::lock_guard lock(mutex_);
  for (const MapViewPtr& v : revisions_) {
    if (v->archive->revision() == number && v->file == newest->file) return v;
  }
  auto view = std::make_shared<MapView>(*newest);
  MAPCODEC_ASSIGN(MapArchive archive, newest->archive->at(number));
  view->archive = std::make_shared<const MapArchive>(std::move(archive));
  MAPCODEC_ASSIGN(view->schema, read_schema(view->archive->info().schema));
  revisions_.push_front(view);
  if (revisions_.size() > kKeepRevisions) revisions_.pop_back();
  return MapViewPtr(std::move(view));
}

Result<MapViewPtr> MapReader::of_file(std::uint64_t file) {
  const std::lock_guard lock(mutex_);
  if (view_ != nullptr && view_->file == file) return view_;
  for (const Replaced& r : replaced_) {
    if (r.view->file == file) return r.view;
  }
  return make_error(ErrorCode::kNotFound, "the archive of '" + name_ + "' was replaced: open it again");
}

void MapReader::changed() {
  const std::lock_guard lock(mutex_);
  changed_ = true;
}

void MapReader::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  view_ = nullptr;
  replaced_.clear();
  revisions_.clear();
}

void MapReader::forget_old_files() {
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  std::erase_if(replaced_, [&](const Replaced& r) { return now - r.since > kKeepReplaced; });
}

MapViewPtr MapReader::last_opened() const {
  const std::lock_guard lock(mutex_);
  return view_;
}

}  // namespace mapcodec
