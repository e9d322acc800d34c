// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/create_map.hpp"

#include <algorithm>
#include <filesystem>
#include <map>

#include "parallel/survey.hpp"
#include "slam_adapter/plan_choice.hpp"
#include "slam_adapter/schema_choice.hpp"
#include "slam_adapter/split_tile.hpp"

namespace mapcodec {
namespace {

// A map grows: what one scan has in a tile is a part of what the tile will hold.
constexpr double kScanPoints = 50000;
// As compress does: surfaces take so few bits that what begins anew with each tile weighs more.
constexpr double kSurfaceScanPoints = 300000;

/// So often can a tile be halved along each axis, where later scans fill it far beyond the others.
constexpr std::uint8_t kSplits = 3;

/// The size of tile that most points of the plan have: a map that grows has tiles of one size.
double usual_size(const TilePlan& plan) {
  std::map<std::uint8_t, std::uint64_t> points;
  for (const TileLeaf& leaf : plan.leaves()) {
    if (!leaf.key.is_unplaced()) points[leaf.key.level] += leaf.points;
  }
  const auto most = std::max_element(points.begin(), points.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == points.end() ? plan.tile_size_m() : std::ldexp(plan.tile_size_m(), most->first);
}

Status check(const CompressOptions& options) {
  MAPCODEC_TRY(check_numbers(options));
  if (options.target_ratio || options.target_bits_per_point)
    return make_error(ErrorCode::kInvalidArgument, "a map that grows cannot have a target of size");
  if (options.keep_order)
    return make_error(ErrorCode::kInvalidArgument, "a map that grows cannot keep an order of points");
  return {};
}

/// Whether the promise is above the distance of the points, which falls with the root of their number.
bool is_coarse(const Survey& look, const CompressOptions& options) {
  if (look.sample.empty() || options.promise != PromiseKind::rms) return false;
  const double thinned = std::sqrt(double(look.sample.size()) / double(look.points));
  return options.promise_m > mean_spacing(look.sample) * thinned;
}

/// The schema as compress would choose it for the points of `look`.
Result<MapSchema> schema_for(Survey look, const CompressOptions& options, Arena& arena,
                             const std::string& folder, std::vector<std::string>& warnings) {
  TilePlanSettings settings;
  settings.tile_size_m = options.tile_size_m > 0 ? std::optional(options.tile_size_m) : std::nullopt;
  settings.target_points = is_coarse(look, options) ? kSurfaceScanPoints : kScanPoints;
  if (options.promise_m > 0) settings.max_side_m = options.promise_m * double(1 << 19);
  MAPCODEC_ASSIGN(TilePlan plan, plan_tiles(look, settings));
  settings.tile_size_m = usual_size(plan);
  MAPCODEC_ASSIGN(plan, plan_tiles(look, settings));
  MAPCODEC_ASSIGN(MapSchema schema,
                  choose_schema(look, options, plan.origin(), *settings.tile_size_m, warnings));
  if (!look.cloud)
    return make_error(ErrorCode::kLimitExceeded, "the first source does not fit the memory budget");
  TileSetSettings tiles_settings;
  tiles_settings.arena = &arena;
  tiles_settings.temp_dir = folder;
  MAPCODEC_ASSIGN(const TileSet tiles, build_tiles(std::move(*look.cloud), plan, tiles_settings));
  MAPCODEC_ASSIGN(const PlanChoice choice, choose_plan(options, tiles, schema, arena, warnings));
  schema.step_m = choice.plan.step_m;
  return schema;
}

}  // namespace

Result<MapSchema> schema_for_growth(PointSource& first, const CompressOptions& options, Arena& arena,
                                    const std::string& path, std::vector<std::string>& warnings) {
  MAPCODEC_TRY(check(options));
  SurveySettings survey_settings;
  survey_settings.arena = &arena;
  survey_settings.stop = options.stop;
  if (options.max_memory_bytes > 0) survey_settings.memory_budget_bytes = options.max_memory_bytes;
  MAPCODEC_ASSIGN(Survey look, survey(first, survey_settings));
  // What all points of the first source have in common, those of the next may not.
  std::fill(look.constant_channels.begin(), look.constant_channels.end(), std::nullopt);
  const auto parent = std::filesystem::path(path).parent_path();
  return schema_for(std::move(look), options, arena, parent.empty() ? "." : parent.string(), warnings);
}

Result<MapUpdater> create_map(const std::string& path, PointSource& first, const CompressOptions& options,
                              Arena& arena, const UpdateSettings& settings,
                              std::vector<std::string>& warnings) {
  MAPCODEC_ASSIGN(MapSchema schema, schema_for_growth(first, options, arena, path, warnings));
  // Tiles of a size that was asked for stay as large as they are.
  const bool splittable = !(options.tile_size_m > 0);
  if (splittable) schema.tile_size_m = std::ldexp(schema.tile_size_m, -kSplits);
  MapInfo info;
  info.schema = write_schema(schema);
  if (splittable) info.extras[kNewTileLevelExtra] = Bytes{kSplits};
  info.origin = schema.origin;
  info.tile_size_m = schema.tile_size_m;
  MAPCODEC_ASSIGN(MapWriter writer, MapWriter::create(path, info, options.overwrite));
  return MapUpdater::over(std::move(writer), arena, settings);
}

}  // namespace mapcodec
