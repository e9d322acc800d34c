// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "slam_adapter/mixture_choice.hpp"
#include "slam_adapter/mixture_search.hpp"

namespace mapcodec {
namespace {

double bits_of(const std::vector<Codings>& tiles, const std::vector<std::size_t>& choice) {
  double bits = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i) bits += tiles[i][choice[i]].bits;
  return bits;
}

/// The fewest bits of all choices within the limit; infinite if there is none.
double fewest_bits(const std::vector<Codings>& tiles, const MixtureLimit& limit) {
  std::vector<std::size_t> choice(tiles.size(), 0);
  double least = INFINITY;
  for (;;) {
    const MixtureLimit lost = lost_by(tiles, choice);
    if (lost.forward <= limit.forward && lost.backward <= limit.backward)
      least = std::min(least, bits_of(tiles, choice));
    std::size_t i = 0;
    while (i < tiles.size() && ++choice[i] == tiles[i].size()) choice[i++] = 0;
    if (i == tiles.size()) return least;
  }
}

std::vector<Codings> random_tiles(std::mt19937& random) {
  std::uniform_real_distribution<double> noise(-0.2, 0.2), scale(0, 3);
  std::vector<Codings> tiles(5);
  for (Codings& t : tiles) {
    const double size = std::exp(scale(random));
    for (int k = -2; k <= 2; ++k) {
      const double step = std::exp(0.5 * k);
      t.push_back({1000 * size / step * std::exp(noise(random)), size * step * step * std::exp(noise(random)),
                   size * step * step * std::exp(noise(random))});
    }
  }
  return tiles;
}

TEST(MixtureChoice, IsNearlyTheBestOfAllChoicesAndWithinTheLimit) {
  std::mt19937 random(7);
  for (int i = 0; i < 40; ++i) {
    const std::vector<Codings> tiles = random_tiles(random);
    const MixtureLimit usual = lost_by(tiles, std::vector<std::size_t>(tiles.size(), 2));
    const MixtureLimit limit{1.1 * usual.forward, 1.1 * usual.backward};
    const auto choice = cheapest_within(tiles, limit);
    const double least = fewest_bits(tiles, limit);
    ASSERT_TRUE(choice);
    const MixtureLimit lost = lost_by(tiles, *choice);
    EXPECT_LE(lost.forward, limit.forward);
    EXPECT_LE(lost.backward, limit.backward);
    EXPECT_LE(bits_of(tiles, *choice), 1.1 * least);
  }
}

TEST(MixtureChoice, TakesTheSmallestWhereAllFits) {
  const std::vector<Codings> tiles{{{10, 1, 1}, {5, 2, 2}}, {{7, 3, 1}, {9, 1, 1}}};
  EXPECT_EQ(cheapest_within(tiles, {100, 100}), (std::vector<std::size_t>{1, 0}));
}

TEST(MixtureChoice, FindsNothingWhereNothingFits) {
  const std::vector<Codings> tiles{{{10, 1, 1}, {5, 2, 2}}};
  EXPECT_FALSE(cheapest_within(tiles, {0.5, 100}));
  EXPECT_FALSE(cheapest_within(tiles, {100, 0.5}));
  EXPECT_EQ(cheapest_within(tiles, {1, 1}), (std::vector<std::size_t>{0}));
}

TEST(MixtureChoice, TakesWhatLosesNothingAtNoLimit) {
  const std::vector<Codings> tiles{{{10, 0, 0}, {8, 0, 0}}, {{4, 0, 0}}};
  EXPECT_EQ(cheapest_within(tiles, {0, 0}), (std::vector<std::size_t>{1, 0}));
}

/// Tiles of 1,000 points: surfaces and points have bits and errors that follow their steps.
struct Codec {
  double surface_bits = 1, points_bits = 3;  // per point at a step of 1 cm
  std::vector<double> walls{};               // tiles that surfaces code in no bits
  double backward = 1;  // of surfaces at the usual weight, in forward errors; a lower weight makes it less

  CodeTiles code() {
    return [this](std::span<const std::size_t> tiles,
                  const TileSettings& s) -> Result<std::vector<std::optional<TileTry>>> {
      std::vector<std::optional<TileTry>> tries;
      for (const std::size_t i : tiles) {
        const bool surface = s.codec == CodecId::surface;
        const double share = s.step_m / 0.01;
        const double bits = (surface ? surface_bits * walls.at(i) : points_bits) / share;
        TileTry t{s, {}, 0};
        t.coded.codec = s.codec;
        t.coded.input_points = t.coded.points = 1000;
        t.coded.bytes.resize(static_cast<std::size_t>(bits * 1000 / 8));
        t.coded.rms_forward_m = t.coded.rms_backward_m = (surface ? 1.3 : 0.5) * s.step_m;
        const double weight = std::pow(s.trade.forward_weight / SurfaceTrade{}.forward_weight, 0.3);
        if (surface) t.coded.rms_forward_m /= weight;
        if (surface) t.coded.rms_backward_m *= weight * backward;
        tries.push_back(std::move(t));
      }
      return tries;
    };
  }
};

double rms_of(const std::vector<TileTry>& tiles) {
  double sum = 0;
  for (const TileTry& t : tiles) sum += t.coded.rms_forward_m * t.coded.rms_forward_m;
  return std::sqrt(sum / double(tiles.size()));
}

TEST(MixtureSearch, SpendsThePromiseAndNoMore) {
  for (const double start_m : {0.001, 0.01, 0.05}) {
    Codec codec;
    codec.walls = {1, 1, 0.1, 0.01};
    const CodeTiles code = codec.code();
    TileSettings surfaces;
    surfaces.step_m = start_m;
    const auto found = MixtureSearch(4, 0.01, code).run(surfaces, true);
    ASSERT_TRUE(found.ok() && *found);
    EXPECT_LE(rms_of(**found), 0.01);
    EXPECT_GE(rms_of(**found), 0.93 * 0.01) << start_m;
  }
}

TEST(MixtureSearch, CodesTilesAsPointsWhereSurfacesCostMore) {
  Codec codec;
  codec.walls = {0.05, 20};
  const CodeTiles code = codec.code();
  TileSettings surfaces;
  surfaces.step_m = 0.01;
  const auto mixed = MixtureSearch(2, 0.01, code).run(surfaces, true);
  ASSERT_TRUE(mixed.ok() && *mixed);
  EXPECT_EQ((**mixed)[0].settings.codec, CodecId::surface);
  EXPECT_EQ((**mixed)[1].settings.codec, CodecId::points);
  const auto alone = MixtureSearch(2, 0.01, code).run(surfaces, false);
  ASSERT_TRUE(alone.ok() && *alone);
  EXPECT_EQ((**alone)[1].settings.codec, CodecId::surface);
}

TEST(MixtureSearch, WeighsTheWorseDirectionMore) {
  const auto more_bytes = [](double backward, double& weight) {
    Codec codec;
    codec.walls = {1, 1, 0.1, 0.1};
    codec.backward = backward;
    const CodeTiles code = codec.code();
    TileSettings surfaces;
    surfaces.step_m = 0.01;
    const auto found = search_mixture(4, 0.01, code, surfaces, false);
    double bytes = 0;
    for (const TileTry& t : **found) bytes += double(t.coded.bytes.size());
    weight = (**found)[0].settings.trade.forward_weight;
    const auto plain = MixtureSearch(4, 0.01, code).run(surfaces, false);
    for (const TileTry& t : **plain) bytes -= double(t.coded.bytes.size());
    return bytes;
  };
  const double usual = SurfaceTrade{}.forward_weight;
  double weight = 0;
  EXPECT_EQ(more_bytes(1.05, weight), 0);  // balanced: nothing more is tried
  EXPECT_EQ(weight, usual);
  EXPECT_LT(more_bytes(1.4, weight), 0);
  EXPECT_LT(weight, usual);
  EXPECT_LT(more_bytes(0.7, weight), 0);
  EXPECT_GT(weight, usual);
}

TEST(MixtureSearch, CodesATileOfFewPointsAsFineAsItsLimitAsks) {
  // Both codecs lose far more there than elsewhere, as with clusters at the corners of cells.
  Codec codec;
  codec.walls = {1, 1, 1, 1};
  const CodeTiles usual = codec.code();
  const CodeTiles code = [&](std::span<const std::size_t> tiles, const TileSettings& s) {
    auto tries = usual(tiles, s);
    for (std::size_t i = 0; i < tiles.size(); ++i) {
      if (tiles[i] != 2) continue;
      EncodedTile& t = (*tries)[i]->coded;
      t.input_points = t.points = 2;
      t.rms_forward_m = t.rms_backward_m = 20 * s.step_m;
    }
    return tries;
  };
  TileSettings surfaces;
  surfaces.step_m = 0.01;
  const auto found = MixtureSearch(4, 0.01, code, 0.015).run(surfaces, true);
  ASSERT_TRUE(found.ok() && *found);
  EXPECT_LE((**found)[2].coded.rms_forward_m, 0.015);
  EXPECT_GE(rms_of(**found), 0.5 * 0.01);
}

TEST(MixtureSearch, FindsNothingWhereTilesCannotBeCoded) {
  const CodeTiles none = [](std::span<const std::size_t> tiles, const TileSettings&) {
    return Result<std::vector<std::optional<TileTry>>>(std::vector<std::optional<TileTry>>(tiles.size()));
  };
  TileSettings surfaces;
  surfaces.step_m = 0.01;
  const auto found = MixtureSearch(2, 0.01, none).run(surfaces, true);
  ASSERT_TRUE(found.ok());
  EXPECT_FALSE(*found);
}

}  // namespace
}  // namespace mapcodec
