// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/verify.hpp"

#include "mapcodec/quality/multiset_hash.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/octomap/octree_jobs.hpp"

namespace mapcodec {
namespace {

Result<std::unique_ptr<PointSource>> open_originals(const std::vector<std::string>& paths,
                                                    const BagOptions& bag, bool keep_nonfinite) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const std::string& path : paths) {
    ReadOptions options;
    options.keep_nonfinite = keep_nonfinite;
    options.bag = bag;
    MAPCODEC_ASSIGN(std::unique_ptr<PointSource> source, open_source(path, options));
    sources.push_back(std::move(source));
  }
  if (sources.size() == 1) return std::move(sources.front());
  return concatenate(std::move(sources));
}

/// Only the channels that the map keeps, in the map's order; those it lacks make an error.
Result<PointCloud> project(const PointCloud& block, const PointCloud& layout) {
  PointCloud r;
  r.coordinates = layout.coordinates;
  r.xyz = block.xyz;
  for (const Channel& want : layout.channels) {
    if (want.info.name == kOrderChannel) continue;
    const Channel* have = block.find(want.info.name);
    if (have == nullptr || have->info != want.info) {
      return make_error(ErrorCode::kInvalidArgument, "the original has no channel " + want.info.name +
                                                         " of type " + want.info.type_name() +
                                                         ", which the map keeps");
    }
    r.channels.push_back(*have);
  }
  return r;
}

Result<MultisetHash> hash_of(PointSource& source, const PointCloud& layout) {
  MultisetHash hash;
  PointCloud block;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, source.next(block));
    if (!more) return hash;
    MAPCODEC_ASSIGN(const PointCloud kept, project(block, layout));
    hash.add(kept);
  }
}

PointCloud without_order(PointCloud cloud) {
  std::erase_if(cloud.channels, [](const Channel& c) { return c.info.name == kOrderChannel; });
  return cloud;
}

Status check_lossless(const MapFile& map, const std::vector<std::string>& originals, const BagOptions& bag,
                      const ReadSettings& settings, VerifyOutcome& v) {
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_originals(originals, bag, true));
  MAPCODEC_ASSIGN(const MultisetHash original, hash_of(*source, map.schema().layout()));
  MultisetHash decoded;
  MAPCODEC_TRY(map.read(Region{}, settings, [&](PointCloud&& cloud) {
    decoded.add(without_order(std::move(cloud)));
    return Status{};
  }));
  v.promise_kept = original == decoded;
  if (!v.promise_kept)
    v.findings.push_back("the points differ from the original's, though the promise was lossless");
  return {};
}

void require(VerifyOutcome& v, bool kept, const std::string& finding) {
  if (kept) return;
  v.promise_kept = false;
  v.findings.push_back(finding);
}

void check_promise(const MapSchema& schema, VerifyOutcome& v) {
  const Evaluation& e = *v.evaluation;
  const double value = schema.promise_value;
  const std::string limit = " m, promised " + std::to_string(value) + " m";
  if (schema.promise == PromiseKind::max_error) {
    require(v, e.max_axis_error_m <= value,
            "largest error along an axis is " + std::to_string(e.max_axis_error_m) + limit);
  } else if (schema.promise == PromiseKind::rms) {
    require(v, e.rms_m <= value, "symmetric RMS is " + std::to_string(e.rms_m) + limit);
  }
  for (const ChannelSchema& c : schema.channels) {
    if (c.info.name != "rgb" || c.kept != ChannelKept::bounded) continue;
    require(v, !(e.color_error > c.bound),
            "colour error is " + std::to_string(e.color_error) + ", promised " + std::to_string(c.bound));
  }
}

Status check_lossy(const MapFile& map, const std::vector<std::string>& originals, const BagOptions& bag,
                   const ReadSettings& settings, VerifyOutcome& v) {
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source, open_originals(originals, bag, false));
  PointCloud original = source->layout(), block;
  for (;;) {
    MAPCODEC_ASSIGN(const bool more, source->next(block));
    if (!more) break;
    original.append(block);
  }
  MAPCODEC_ASSIGN(const PointCloud decoded, map.read(Region{}, settings));
  Arena serial(1);
  TbbRunner runner(settings.arena != nullptr ? *settings.arena : serial);
  MAPCODEC_ASSIGN(v.evaluation, evaluate(original, decoded, runner, {}));
  require(v, map.archive().info().input_points == original.size(),
          "the map was made of " + std::to_string(map.archive().info().input_points) +
              " points, the original has " + std::to_string(original.size()));
  check_promise(map.schema(), v);
  return {};
}

/// An octree has no order and no loss: it is the same or not.
Status check_octree(const MapFile& map, const std::vector<std::string>& originals,
                    const ReadSettings& settings, VerifyOutcome& v) {
  MAPCODEC_ASSIGN(const OctreeFile original, read_octrees(originals));
  MAPCODEC_ASSIGN(const std::string difference, compare_occupancy_map(map.path(), original, settings));
  require(v, difference.empty(), difference);
  return {};
}

/// Every tile decodes, to as many points as the index says.
Result<VerifyOutcome> check_tiles(const MapFile& map, const ReadSettings& settings) {
  VerifyOutcome v;
  v.tiles = map.archive().tiles().size();
  MAPCODEC_TRY(map.read(Region{}, settings, [&](PointCloud&& cloud) {
    v.points += cloud.size();
    return Status{};
  }));
  if (octree_submap(map.archive().info())) {
    MAPCODEC_ASSIGN(const OccupancyMap octree, OccupancyMap::open(map.path()));
    MAPCODEC_ASSIGN(const OccupancyTree tree, octree.read({}, settings));
    std::uint64_t leaves = 0;
    for (const std::size_t i : octree.tiles_in({})) leaves += map.archive().tiles()[i].points;
    if (tree.leaf_count() != leaves)
      return make_error(ErrorCode::kArchiveDamaged,
                        "the octree has another number of leaves than the index says");
  }
  if (v.points != map.summary().points) {
    return make_error(ErrorCode::kArchiveDamaged, "tiles decode to " + std::to_string(v.points) +
                                                      " points, the index says " +
                                                      std::to_string(map.summary().points));
  }
  return v;
}

}  // namespace

Result<VerifyOutcome> verify_map(const std::string& path, const ReadSettings& settings) {
  // An archive whose last commit is damaged still opens, at the one before: the whole file is looked at
  // first.
  MAPCODEC_ASSIGN(const VerifyReport report, verify_archive(path));
  if (!report.ok() && !report.only_unfinished()) return report.findings.front();
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  MAPCODEC_ASSIGN(VerifyOutcome v, check_tiles(map, settings));
  v.trailing_bytes = report.trailing_bytes;
  return v;
}

Result<VerifyOutcome> verify_map_against(const std::string& path, const std::vector<std::string>& originals,
                                         const ReadSettings& settings, const BagOptions& bag) {
  MAPCODEC_ASSIGN(VerifyOutcome v, verify_map(path, settings));
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(path));
  if (any_octree(originals)) {
    MAPCODEC_TRY(check_octree(map, originals, settings, v));
    return v;
  }
  MAPCODEC_TRY(map.schema().promise == PromiseKind::lossless
                   ? check_lossless(map, originals, bag, settings, v)
                   : check_lossy(map, originals, bag, settings, v));
  return v;
}

}  // namespace mapcodec
