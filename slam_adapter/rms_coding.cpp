// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rms_coding.hpp"

#include <optional>

#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/mixture_search.hpp"
#include "slam_adapter/trade_search.hpp"

namespace mapcodec {
namespace {

// Of the rms of all: what lies farther from its tile's surfaces would not be known when it is seen again.
constexpr double kMostTileRms = 1.5;
constexpr std::size_t kTradeShare = 8;  // of the points, one in so many

double first_step(const MapSchema& schema, double rms_m) {
  return schema.step_m > 0 ? schema.step_m : 0.5 * rms_m;
}

class TilesForRms {
 public:
  TilesForRms(std::span<const RmsTile> tiles, const MapSchema& schema, double rms_m, const RunEach& run)
      : tiles_(tiles), schema_(schema), bare_(positions_alone(schema)), rms_m_(rms_m), run_(run) {}

  Result<std::vector<EncodedTile>> encode() {
    CodingPlan plan;
    plan.choice = CodecChoice::surface;
    plan.step_m = first_step(schema_, rms_m_);
    MAPCODEC_ASSIGN(plan, choose_trade(std::move(plan)));
    TileSettings surfaces = plan.tiles;
    surfaces.step_m = plan.step_m;
    const CodeTiles code = [this](std::span<const std::size_t> tiles, const TileSettings& settings) {
      return try_all(tiles, settings);
    };
    MAPCODEC_ASSIGN(const auto settled,
                    search_mixture(tiles_.size(), rms_m_, code, surfaces, true, kMostTileRms * rms_m_));
    if (!settled) return make_error(ErrorCode::kPromiseBroken, "no coding of the tiles keeps the promise");
    std::vector<EncodedTile> coded(tiles_.size());
    MAPCODEC_TRY(run_(tiles_.size(), [&](std::size_t i) -> Status {
      MAPCODEC_ASSIGN(coded[i], encode_tile(tiles_[i].points, schema_, (*settled)[i].settings));
      return {};
    }));
    return coded;
  }

 private:
  Result<std::vector<std::optional<TileTry>>> try_all(std::span<const std::size_t> tiles,
                                                      const TileSettings& settings) const {
    std::vector<std::optional<TileTry>> tries(tiles.size());
    MAPCODEC_TRY(run_(tiles.size(), [&](std::size_t i) -> Status {
      TileSettings own = settings;
      own.borders = tiles_[tiles[i]].borders;
      auto coded = encode_tile(tiles_[tiles[i]].points, bare_, own);
      if (coded.ok()) tries[i] = TileTry{own, std::move(coded).value()};
      return {};
    }));
    return tries;
  }

  /// On some of the tiles, so that it takes about as long as one coding of all.
  Result<CodingPlan> choose_trade(CodingPlan plan) const {
    const std::vector<std::size_t> some = some_tiles();
    const MeasurePlan measure = [&](const CodingPlan& trial) -> Result<CodedSum> {
      std::vector<EncodedTile> coded(some.size());
      MAPCODEC_TRY(run_(some.size(), [&](std::size_t i) -> Status {
        CodingPlan own = trial;
        own.tiles.borders = tiles_[some[i]].borders;
        MAPCODEC_ASSIGN(coded[i], encode_by_plan(tiles_[some[i]].points, bare_, own));
        return {};
      }));
      CodedSum sum;
      for (const EncodedTile& t : coded) sum.add(t);
      return sum;
    };
    return TradeSearch(rms_m_, measure).run(std::move(plan));
  }

  /// Evenly spread.
  std::vector<std::size_t> some_tiles() const {
    std::size_t before = 0, taken = 0;
    std::vector<std::size_t> some;
    for (std::size_t i = 0; i < tiles_.size(); ++i) {
      const std::size_t middle = before + tiles_[i].points.size() / 2;
      before += tiles_[i].points.size();
      if (!some.empty() && taken >= middle / kTradeShare) continue;
      taken += tiles_[i].points.size();
      some.push_back(i);
    }
    return some;
  }

  std::span<const RmsTile> tiles_;
  const MapSchema& schema_;
  const MapSchema bare_;
  const double rms_m_;
  const RunEach& run_;
};

}  // namespace

Result<EncodedTile> encode_for_rms(const RmsTile& tile, const MapSchema& schema, double rms_m) {
  const RunEach one = [](std::size_t count, const std::function<Status(std::size_t)>& body) -> Status {
    for (std::size_t i = 0; i < count; ++i) MAPCODEC_TRY(body(i));
    return {};
  };
  MAPCODEC_ASSIGN(auto coded, TilesForRms({&tile, 1}, schema, rms_m, one).encode());
  return std::move(coded.front());
}

Result<std::vector<EncodedTile>> encode_for_rms_together(std::span<const RmsTile> tiles,
                                                         const MapSchema& schema, double rms_m,
                                                         const RunEach& run) {
  if (tiles.empty()) return std::vector<EncodedTile>{};
  return TilesForRms(tiles, schema, rms_m, run).encode();
}

}  // namespace mapcodec
