// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/map_coding.hpp"

#include <unistd.h>

#include <algorithm>

#include "parallel/encode_pipeline.hpp"
#include "slam_adapter/stopwatch.hpp"

namespace mapcodec {
namespace {

// Of the memory budget: for what codings of the same positions have in common.
constexpr std::uint64_t kMemoryShare = 8;

}  // namespace

std::uint64_t memory_budget(const CompressOptions& options) {
  if (options.max_memory_bytes != 0) return options.max_memory_bytes;
  const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
  return pages > 0 && page > 0 ? std::uint64_t(pages) * std::uint64_t(page) / 2 : std::uint64_t{2} << 30;
}

MapCoding::MapCoding(const CodingInput& input, const CompressOptions& options, MapSchema schema,
                     Effort search_effort)
    : input_(input),
      options_(options),
      search_effort_(search_effort),
      schema_(std::move(schema)),
      position_step_(schema_.step_m),
      levels_(input.tiles) {}

Status MapCoding::run() {
  Stopwatch watch;
  CompressOptions search = options_;
  search.effort = search_effort_;
  MAPCODEC_ASSIGN(choice_, choose_plan(search, input_.tiles, schema_, input_.arena, report_.warnings));
  choice_.plan.tiles.effort = options_.effort;
  report_.search_seconds = watch.lap();
  for (std::size_t i = 0; i < choice_.tiles.size(); ++i)
    chosen_.emplace(input_.tiles.tiles()[i].key, choice_.tiles[i]);
  adjuster_.emplace(options_, schema_, choice_, position_step_);
  return encode_until_kept();
}

Status MapCoding::encode_until_kept() {
  constexpr int kTries = 16;
  for (int i = 0;; ++i) {
    Stopwatch watch;
    MAPCODEC_TRY(encode_once());
    report_.tiles_seconds += watch.lap();
    report_.codings = i + 1;
    if (adjuster_->is_kept_or_adjust(coded_)) break;
    if (i + 1 == kTries)
      return make_error(ErrorCode::kPromiseBroken, "no step was found that keeps the promise");
  }
  adjuster_->say_what_color_cost(report_.warnings);
  adjuster_->record_reachable_color();
  return {};
}

Status MapCoding::encode_once() {
  coded_ = {};
  bounds_ = {};
  report_.geometry_bytes = 0;
  report_.tile_seconds.clear();
  levels_.clear();
  schema_.step_m = choice_.plan.step_m;
  choice_.plan.tiles.color_slope = adjuster_->color_slope();
  MAPCODEC_TRY(begin_archive());
  PipelineSettings pipeline;
  pipeline.arena = &input_.arena;
  pipeline.memory_budget_bytes = memory_budget(options_);
  pipeline.progress = options_.progress;
  pipeline.stop = options_.stop;
  pipeline.tile_seconds = &report_.tile_seconds;
  if (is_coded()) return store_coded();
  MapSchema target = schema_;
  if (const auto color = bounded_color(schema_)) target.channels[*color].bound *= adjuster_->color_target();
  const bool positions_only = adjuster_->wants_positions_alone();
  if (positions_only) target = positions_alone(target);
  if (positions_only) memory_.begin(memory_budget(options_) / kMemoryShare);
  MAPCODEC_TRY(encode_tiles(
      input_.tiles, [&](const PointCloud& tile) { return encode(tile, target); }, pipeline,
      [this](const TileKey& key, EncodedTile&& t) { return store(key, std::move(t)); }));
  add_saved_seconds();
  return {};
}

Status MapCoding::begin_archive() {
  MapInfo info;
  info.schema = write_schema(schema_);
  info.origin = input_.plan.origin();
  info.tile_size_m = schema_.tile_size_m;
  writer_.reset();
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(input_.path, info, options_.overwrite));
  writer_ = std::make_unique<MapWriter>(std::move(writer));
  return {};
}

/// What a tile's coding takes is told as if nothing had been remembered.
void MapCoding::add_saved_seconds() {
  for (std::size_t i = 0; i < report_.tile_seconds.size(); ++i)
    report_.tile_seconds[i] += memory_.seconds_saved(input_.tiles.tiles()[i].key);
}

/// Whether the search has coded the whole map already: positions are all of it, and it was not coded since.
bool MapCoding::is_coded() const {
  const auto dropped = [](const ChannelSchema& c) { return c.kept == ChannelKept::dropped; };
  return report_.codings == 0 && choice_.coded &&
         choice_.coded->tiles.size() == input_.tiles.tiles().size() &&
         std::all_of(schema_.channels.begin(), schema_.channels.end(), dropped);
}

Status MapCoding::store_coded() {
  for (std::size_t i = 0; i < input_.tiles.tiles().size(); ++i)
    MAPCODEC_TRY(store(input_.tiles.tiles()[i].key, std::move(choice_.coded->tiles[i])));
  report_.tile_seconds = choice_.coded->seconds;
  const auto points = static_cast<std::uint64_t>(coded_.points());
  if (options_.progress) options_.progress({"encode", points, points, report_.geometry_bytes});
  choice_.coded.reset();
  return {};
}

/// Later codings keep to the codecs of the first: with a little other step some tiles would change over, and
/// the error of the map would leap to the other side of the promise.
Result<EncodedTile> MapCoding::encode(const PointCloud& tile, const MapSchema& target) {
  CodingPlan plan = choice_.plan;
  const auto key = input_.plan.tile_of(tile.xyz.front());
  if (!key) return encode_by_plan(tile, target, plan);
  plan.tiles.borders = input_.neighbors.borders_of(*key);
  const bool chosen = report_.codings > 0 || !choice_.tiles.empty();
  if (plan.choice == CodecChoice::cheapest && chosen) {
    const auto own = chosen_.find(*key);
    if (own != chosen_.end()) {
      plan.fixed = own->second.codec;
      plan.step_m *= own->second.step_share;
    }
  }
  return adjuster_->has_color_slope() ? memory_.encode(*key, tile, target, plan)
                                      : encode_by_plan(tile, target, plan);
}

Status MapCoding::store(const TileKey& key, EncodedTile&& t) {
  coded_.add(t);
  levels_.keep(key, t);
  if (choice_.tiles.empty()) chosen_.emplace(key, TileChoice{t.codec});
  bounds_.add(t.bounds);
  report_.geometry_bytes += t.geometry_bytes;
  return writer_->add(key, static_cast<std::uint8_t>(t.codec), t.points, t.bounds, t.errors, t.bytes);
}

}  // namespace mapcodec
