// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/fold_tiles.hpp"

#include <algorithm>

namespace mapcodec {
namespace {

/// A tile's segments, sorted into what stays and what is coded again.
struct Parts {
  std::vector<Bytes> kept;            ///< folded before, and erasures that concern them
  std::optional<PointCloud> pending;  ///< the points to be coded
  bool any_pending = false;           ///< among those
  bool to_fold = false;
  TileBorders borders;

  Status open(const FoldTask& task, const MapSchema& schema) {
    borders = task.borders;
    const Bytes joined = join_segments(task.segments);
    MAPCODEC_ASSIGN(const std::vector<ByteSpan> all, split_segments(joined));
    to_fold = task.segments.size() > 1 || std::any_of(all.begin(), all.end(), is_pending);
    if (!to_fold) return {};
    for (const ByteSpan s : all) MAPCODEC_TRY(take(s, schema));
    if (pending && pending->empty()) pending.reset();
    return {};
  }

 private:
  Status take(ByteSpan segment, const MapSchema& schema) {
    if (is_erasure(segment)) return erase(segment);
    any_pending = any_pending || is_pending(segment);
    if (!is_exact_again(schema) && !is_pending(segment)) {
      kept.emplace_back(segment.begin(), segment.end());
      return {};
    }
    MAPCODEC_ASSIGN(PointCloud cloud, decode_tile(segment, schema));
    if (pending) {
      pending->append(cloud);
    } else {
      pending = std::move(cloud);
    }
    return {};
  }

  Status erase(ByteSpan segment) {
    MAPCODEC_ASSIGN(const Erasure e, read_erasure(segment));
    if (pending) MAPCODEC_TRY(erase_points(*pending, e));
    if (!kept.empty()) kept.emplace_back(segment.begin(), segment.end());
    return {};
  }
};

/// @param coded  of the pending points, if there were any.
Result<Fold> close(Parts parts, std::optional<EncodedTile> coded, const FoldTask& task,
                   const MapSchema& schema) {
  Fold fold;
  fold.errors = task.errors;
  fold.bounds = task.bounds;
  if (coded) {
    fold.bounds.add(coded->bounds);
    parts.kept.push_back(std::move(coded->bytes));
    fold.coded_points = coded->points;
    fold.forward_m = coded->rms_forward_m;
    fold.backward_m = coded->rms_backward_m;
  }
  if (parts.kept.empty()) return fold;
  fold.bytes = join_segments(parts.kept);
  fold.codec = fold.bytes[0];
  MAPCODEC_ASSIGN(const PointCloud left, decode_tile(fold.bytes, schema));
  fold.points = left.size();
  if (coded && !is_exact_again(schema) && fold.points > 0) {
    const double share = std::min(1.0, double(coded->points) / double(fold.points));
    fold.errors = joint_errors(task.errors, coded->errors, share);
  }
  return fold;
}

/// Codes what is pending in each tile. @return nothing where nothing is.
Result<std::vector<std::optional<EncodedTile>>> code_pending(std::vector<Parts>& parts,
                                                             const MapSchema& schema, double rms_m,
                                                             const RunEach& run) {
  std::vector<std::optional<EncodedTile>> coded(parts.size());
  if (schema.promise != PromiseKind::rms) {
    MAPCODEC_TRY(run(parts.size(), [&](std::size_t i) -> Status {
      if (!parts[i].pending) return {};
      MAPCODEC_ASSIGN(coded[i],
                      encode_for_good(std::move(*parts[i].pending), schema, parts[i].any_pending, {}));
      return {};
    }));
    return coded;
  }
  std::vector<RmsTile> tiles;
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (!parts[i].pending) continue;
    tiles.push_back({with_all_channels(std::move(*parts[i].pending), schema), parts[i].borders});
    numbers.push_back(i);
  }
  const MapSchema target = schema_for_good(schema, true);
  MAPCODEC_ASSIGN(auto together, encode_for_rms_together(tiles, target, rms_m, run));
  for (std::size_t i = 0; i < numbers.size(); ++i) coded[numbers[i]] = std::move(together[i]);
  return coded;
}

}  // namespace

Result<std::vector<std::optional<Fold>>> fold_tiles(std::span<const FoldTask> tasks, const MapSchema& schema,
                                                    double rms_m, const RunEach& run) {
  std::vector<Parts> parts(tasks.size());
  MAPCODEC_TRY(run(tasks.size(), [&](std::size_t i) { return parts[i].open(tasks[i], schema); }));
  MAPCODEC_ASSIGN(auto coded, code_pending(parts, schema, rms_m, run));
  std::vector<std::optional<Fold>> folds(tasks.size());
  MAPCODEC_TRY(run(tasks.size(), [&](std::size_t i) -> Status {
    if (!parts[i].to_fold) return {};
    MAPCODEC_ASSIGN(folds[i], close(std::move(parts[i]), std::move(coded[i]), tasks[i], schema));
    return {};
  }));
  return folds;
}

}  // namespace mapcodec
