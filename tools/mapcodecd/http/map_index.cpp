// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/map_index.hpp"

#include <nlohmann/json.hpp>

#include "tools/mapcodecd/http/tile_path.hpp"

namespace mapcodec::daemon {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kKept = 16;  // a text can have 20 MB for 100,000 tiles

std::string hexadecimal(ByteSpan bytes) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string out;
  for (const std::uint8_t byte : bytes) {
    out += kDigits[byte >> 4];
    out += kDigits[byte & 15];
  }
  return out;
}

Json box_json(const Box& box) {
  return {{"min", box.min}, {"max", box.max}};
}

Json tile_json(const TileRecord& tile) {
  Json j;
  j["key"] = tile_path({tile.submap, tile.key});
  j["points"] = tile.points;
  j["segments"] = Json::array();
  for (const SegmentRef& segment : tile.segments) j["segments"].push_back(segment.length);
  // Where the archive does not store them they are not made: that would read the whole map.
  if (tile.hashes.size() == tile.segments.size()) j["etag"] = hash_tile(tile.codec, tile.hashes).to_string();
  if (!tile.key.is_unplaced()) j["bounds"] = box_json(tile.bounds);
  return j;
}

Json submap_json(const Submap& submap) {
  return {{"name", submap.name},
          {"translation_m", submap.translation_m},
          {"rotation_xyzw", submap.rotation_xyzw}};
}

Json facts_json(const MapView& view) {
  const MapInfo& info = view.archive->info();
  Json j;
  j["map"] = view.name;
  j["revision"] = view.archive->revision();
  j["timestamp_s"] = view.archive->timestamp_s();
  j["format_version"] = kArchiveFormatVersion;
  j["schema"] = hexadecimal(info.schema);
  j["origin_m"] = info.origin;
  j["tile_size_m"] = info.tile_size_m;
  j["submaps"] = Json::array();
  for (const Submap& submap : info.submaps) j["submaps"].push_back(submap_json(submap));
  j["snapshots"] = Json::array();
  for (const Snapshot& s : info.snapshots)
    j["snapshots"].push_back({{"name", s.name}, {"revision", s.revision}});
  return j;
}

/// Names may hold any bytes: those that are no UTF-8 are replaced, not thrown about.
std::string dumped(const Json& j) {
  return j.dump(-1, ' ', false, Json::error_handler_t::replace);
}

MapIndex make_index(const MapView& view) {
  MapIndex index;
  index.text = dumped(facts_json(view));
  index.text.back() = ',';
  index.text += "\"tiles\":[";
  for (const TileRecord& tile : view.archive->tiles()) index.text += dumped(tile_json(tile)) + ",\n";
  if (index.text.back() == '\n') index.text.resize(index.text.size() - 2);
  index.text += "]}\n";
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(index.text.data());
  index.etag = '"' + hash_bytes({bytes, index.text.size()}).to_string() + '"';
  return index;
}

}  // namespace

std::shared_ptr<const MapIndex> MapIndexes::index(const MapView& view) {
  const std::lock_guard lock(mutex_);
  const std::uint64_t revision = view.archive->revision();
  for (auto at = entries_.begin(); at != entries_.end(); ++at) {
    if (at->map != view.name || at->file != view.file || at->revision != revision) continue;
    entries_.splice(entries_.begin(), entries_, at);
    return entries_.front().index;
  }
  entries_.push_front({view.name, view.file, revision, std::make_shared<const MapIndex>(make_index(view))});
  if (entries_.size() > kKept) entries_.pop_back();
  return entries_.front().index;
}

}  // namespace mapcodec::daemon
