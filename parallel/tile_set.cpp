// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/tile_set.hpp"

#include "parallel/guard.hpp"
#include "parallel/runner.hpp"
#include "parallel/sort_by_tile.hpp"
#include "parallel/spilled_points.hpp"

namespace mapcodec {
namespace {

using parallel_detail::cancelled;
using parallel_detail::guarded;
using parallel_detail::stop_asked;

class PointsInMemory final : public TileSet::Points {
 public:
  PointsInMemory(PointCloud cloud, TileOrder order) : cloud_(std::move(cloud)), order_(std::move(order)) {}

  Result<PointCloud> load(std::size_t i) const override {
    const auto first = order_.order.begin();
    return cloud_.gather({first + order_.runs[i].begin, first + order_.runs[i].end});
  }

 private:
  PointCloud cloud_;
  TileOrder order_;
};

/// Calls `f` with the arena's runner, or the serial one.
template <class F>
auto with_runner(Arena* arena, F&& f) {
  SerialRunner serial;
  if (arena == nullptr) return f(static_cast<Runner&>(serial));
  TbbRunner parallel(*arena);
  return f(static_cast<Runner&>(parallel));
}

void report(const TileSetSettings& settings, std::uint64_t done, std::uint64_t total) {
  if (settings.progress) settings.progress({"tiling", done, total, 0});
}

Error other_points() {
  return make_error(ErrorCode::kMalformed, "the source gave other points when it was read again");
}

Status pass_to(SpilledPoints& spill, PointSource& source, const TilePlan& plan,
               const TileSetSettings& settings) {
  std::uint64_t done = 0;
  PointCloud block;
  for (;;) {
    if (stop_asked(settings.stop)) return cancelled("tiling");
    MAPCODEC_ASSIGN(const bool more, source.next(block));
    if (!more) break;
    done += block.size();
    if (done > plan.points()) return other_points();
    MAPCODEC_TRY(spill.add(block));
    report(settings, done, plan.points());
  }
  return done == plan.points() ? Status() : Status(other_points());
}

Result<TileSet> sort_in_memory(PointCloud cloud, const TilePlan& plan, const TileSetSettings& settings,
                               Runner& runner) {
  if (stop_asked(settings.stop)) return cancelled("tiling");
  if (cloud.size() >= KeyIndex::kNone)
    return make_error(ErrorCode::kLimitExceeded, "too many points to sort in memory");
  PointCloud layout = cloud.like();
  MAPCODEC_ASSIGN(TileOrder order, sort_by_tile(cloud.xyz, plan, runner));
  report(settings, cloud.size(), cloud.size());
  std::vector<TileSet::Entry> tiles;
  for (const TileRun& r : order.runs) tiles.push_back({r.key, r.size()});
  return TileSet(std::move(layout), std::move(tiles),
                 std::make_unique<PointsInMemory>(std::move(cloud), std::move(order)));
}

Result<TileSet> sort_on_disk(PointSource& source, const TilePlan& plan, const TileSetSettings& settings,
                             Runner& runner) {
  MAPCODEC_TRY(source.rewind());
  PointCloud layout = source.layout().like();
  MAPCODEC_ASSIGN(SpillFile file, SpillFile::create(settings.temp_dir));
  auto spill = std::make_unique<SpilledPoints>(layout, std::move(file));
  spill->begin(plan, runner, settings.memory_budget_bytes);
  MAPCODEC_TRY(pass_to(*spill, source, plan, settings));
  MAPCODEC_ASSIGN(std::vector<TileSet::Entry> tiles, spill->finish());
  return TileSet(std::move(layout), std::move(tiles), std::move(spill));
}

}  // namespace

TileSet::TileSet(PointCloud layout, std::vector<Entry> tiles, std::unique_ptr<Points> points)
    : layout_(std::move(layout)), tiles_(std::move(tiles)), points_(std::move(points)) {
  for (const Entry& t : tiles_) total_ += t.points;
}

Result<PointCloud> TileSet::load(std::size_t i) const {
  return guarded("tile", [&] { return points_->load(i); });
}

Result<TileSet> build_tiles(PointCloud cloud, const TilePlan& plan, const TileSetSettings& settings) {
  return guarded("tiling", [&] {
    return with_runner(settings.arena, [&](Runner& runner) {
      return sort_in_memory(std::move(cloud), plan, settings, runner);
    });
  });
}

Result<TileSet> build_tiles(PointSource& source, const TilePlan& plan, const TileSetSettings& settings) {
  return guarded("tiling", [&] {
    return with_runner(settings.arena,
                       [&](Runner& runner) { return sort_on_disk(source, plan, settings, runner); });
  });
}

}  // namespace mapcodec
