// SPDX-License-Identifier: GPL-3.0-or-later
// A map whose every revision can be told from its number alone: what a killed writer left is checked against
// it.
#pragma once

#include <map>
#include <random>
#include <set>
#include <string>

#include "maps/compaction.hpp"
#include "maps/map_archive.hpp"
#include "maps/map_writer.hpp"

namespace mapcodec::fault {

inline constexpr double kTileSize = 10;

inline MapInfo map_info() {
  MapInfo info;
  info.schema = {'f', 'a', 'u', 'l', 't'};
  info.tile_size_m = kTileSize;
  return info;
}

/// The bytes of a tile (or of one of its deltas) that revision `revision` wrote: random, and alike each time.
inline Bytes tile_bytes(const TileKey& key, std::uint64_t revision) {
  std::mt19937_64 random(revision * 1000003 + static_cast<std::uint64_t>(key.x * 97 + key.y));
  Bytes bytes(200 + random() % 40000);
  for (std::size_t i = 0; i < bytes.size(); i += 8) {
    const std::uint64_t word = random();
    for (std::size_t k = 0; k < 8 && i + k < bytes.size(); ++k)
      bytes[i + k] = static_cast<std::uint8_t>(word >> (8 * k));
  }
  return bytes;
}

/// Which revisions wrote the segments of each tile.
using Model = std::map<TileKey, std::vector<std::uint64_t>, MortonLess>;

struct Step {
  enum Kind { add, extend, remove } kind = add;
  TileKey key;
};

/// What revision `revision` does to the model of the one before.
inline std::vector<Step> steps_of(std::uint64_t revision, const Model& before) {
  std::mt19937_64 random(revision * 7919);
  std::vector<Step> steps;
  std::set<std::pair<int, int>> used;
  for (int i = 0; i < 8; ++i) {
    const TileKey key{static_cast<std::int32_t>(random() % 8), static_cast<std::int32_t>(random() % 8), 0, 0};
    const std::uint64_t dice = random() % 8;
    if (!used.insert({key.x, key.y}).second) continue;
    const bool there = before.contains(key);
    steps.push_back({!there || dice < 4 ? Step::add : dice < 7 ? Step::extend : Step::remove, key});
  }
  return steps;
}

inline void apply(const std::vector<Step>& steps, std::uint64_t revision, Model& model) {
  for (const Step& s : steps) {
    if (s.kind == Step::remove) {
      model.erase(s.key);
    } else if (s.kind == Step::add) {
      model[s.key] = {revision};
    } else {
      model[s.key].push_back(revision);
    }
  }
}

/// Writes `steps` as the writer's next revision. Errors: as MapWriter.
inline Status write(MapWriter& writer, const std::vector<Step>& steps) {
  const std::uint64_t revision = writer.revision() + 1;
  for (const Step& s : steps) {
    const Bytes bytes = tile_bytes(s.key, revision);
    const Box box = tile_cube(s.key, {0, 0, 0}, kTileSize);
    if (s.kind == Step::remove) MAPCODEC_TRY(writer.remove(s.key));
    if (s.kind == Step::add) MAPCODEC_TRY(writer.add(s.key, 2, 1, box, {}, bytes));
    if (s.kind == Step::extend) MAPCODEC_TRY(writer.extend(s.key, 1, box, {}, bytes));
  }
  const auto done = writer.commit(static_cast<std::int64_t>(revision));
  return done.ok() ? Status() : Status(done.error());
}

/// Joins what `MapWriter::extend` left apart, so that a fold is seen by the check.
inline Result<std::optional<FoldedTile>> fold(const MapInfo&, const TileRecord& tile,
                                              const std::vector<Bytes>& segments) {
  FoldedTile folded{tile.codec, tile.points, tile.bounds, tile.errors, {}};
  for (const Bytes& s : segments) folded.bytes.insert(folded.bytes.end(), s.begin(), s.end());
  return std::optional(folded);
}

/// "" if the archive's newest revision is the one its number tells, whole, and every other byte is in order
/// but for the tail of an unfinished commit; otherwise what is wrong.
inline std::string check(const std::string& path, const Model& model, std::uint64_t revision) {
  const auto archive = MapArchive::open(path);
  if (!archive.ok()) return "cannot be opened: " + archive.error().to_string();
  if (archive->revision() != revision)
    return "is at revision " + std::to_string(archive->revision()) + ", not " + std::to_string(revision);
  if (archive->tiles().size() != model.size()) return "has another number of tiles";
  for (const TileRecord& tile : archive->tiles()) {
    const auto expected = model.find(tile.key);
    if (expected == model.end()) return "has a tile too many";
    Bytes stored, written;
    for (const SegmentRef& s : tile.segments) {
      const auto bytes = archive->read(s);
      if (!bytes.ok()) return bytes.error().to_string();
      stored.insert(stored.end(), bytes->begin(), bytes->end());
    }
    for (const std::uint64_t r : expected->second) {
      const Bytes bytes = tile_bytes(tile.key, r);
      written.insert(written.end(), bytes.begin(), bytes.end());
    }
    if (stored != written) return "tile " + tile_name(tile) + " holds other bytes than were written";
  }
  const auto report = archive->verify();
  if (!report.ok()) return report.error().to_string();
  for (const Error& e : report->findings) {
    if (e.offset != archive->file_bytes()) return e.to_string();
  }
  return archive->lost_newest() ? "ends with a damaged commit" : "";
}

}  // namespace mapcodec::fault
