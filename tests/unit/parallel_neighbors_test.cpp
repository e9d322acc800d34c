// SPDX-License-Identifier: GPL-3.0-or-later
// Which tiles lie side by side.
#include <gtest/gtest.h>

#include <random>

#include "parallel/tile_neighbors.hpp"

namespace mapcodec {
namespace {

constexpr Vec3 kOrigin{10, 20, 30};

TileNeighbors beside(const std::vector<TileKey>& tiles) {
  return {tiles, kOrigin, 2};
}

/// The faces at which tiles lie, found pair by pair: cubes that share more of a plane than an edge.
std::uint8_t touching(const TileKey& key, const std::vector<TileKey>& tiles) {
  const Box a = tile_cube(key, {0, 0, 0}, 1);
  std::uint8_t faces = 0;
  for (const TileKey& other : tiles) {
    const Box b = tile_cube(other, {0, 0, 0}, 1);
    for (unsigned face = 0; face < 6; ++face) {
      const unsigned d = face / 2, u = (d + 1) % 3, v = (d + 2) % 3;
      const bool meet = face % 2 == 0 ? b.max[d] == a.min[d] : b.min[d] == a.max[d];
      const bool share =
          b.min[u] < a.max[u] && a.min[u] < b.max[u] && b.min[v] < a.max[v] && a.min[v] < b.max[v];
      if (meet && share) faces |= static_cast<std::uint8_t>(1u << face);
    }
  }
  return faces;
}

TEST(TileNeighbors, OneTileHasNone) {
  const TileKey key{3, -2, 5, 0};
  const TileBorders b = beside({key}).borders_of(key);
  EXPECT_EQ(b.occupied, 0);
  EXPECT_EQ(b.cube.min, (Vec3{16, 16, 40}));
  EXPECT_EQ(b.cube.max, (Vec3{18, 18, 42}));
  EXPECT_EQ(beside({}).borders_of(key).occupied, 0);
}

TEST(TileNeighbors, EachFaceHasItsBit) {
  const TileKey key{0, 0, 0, 0};
  const std::vector<TileKey> around = {{-1, 0, 0, 0}, {1, 0, 0, 0},  {0, -1, 0, 0},
                                       {0, 1, 0, 0},  {0, 0, -1, 0}, {0, 0, 1, 0}};
  for (unsigned face = 0; face < 6; ++face) {
    const TileBorders b = beside({key, around[face]}).borders_of(key);
    EXPECT_EQ(b.occupied, 1u << face);
    EXPECT_TRUE(b.goes_on(face / 2, face % 2 == 1));
    EXPECT_FALSE(b.goes_on(face / 2, face % 2 == 0));
  }
}

TEST(TileNeighbors, EdgesAndCornersAreNone) {
  const TileKey key{0, 0, 0, 0};
  EXPECT_EQ(beside({key, {1, 1, 0, 0}, {-1, 1, 1, 0}, {2, 0, 0, 0}}).borders_of(key).occupied, 0);
}

TEST(TileNeighbors, SmallerAndLargerOnes) {
  const TileKey large{0, 0, 0, 2};                                         // 4 x 4 x 4 of level 0
  EXPECT_EQ(beside({large, {4, 3, 0, 0}}).borders_of(large).occupied, 2);  // a small one at the upper x face
  EXPECT_EQ(beside({large, {4, 3, 0, 0}}).borders_of({4, 3, 0, 0}).occupied, 1);
  EXPECT_EQ(beside({large, {-1, 0, 0, 1}}).borders_of(large).occupied, 1);
  // Within a cube of the tile's size, if not at its face: the surface may go on.
  EXPECT_EQ(beside({large, {7, 0, 0, 0}}).borders_of(large).occupied, 2);
}

TEST(TileNeighbors, UnplacedTilesLieBesideNone) {
  const TileKey key{0, 0, 0, 0};
  const TileKey nowhere = TileKey::unplaced();
  ASSERT_TRUE(nowhere.is_unplaced());
  EXPECT_EQ(beside({key, nowhere}).borders_of(key).occupied, 0);
  EXPECT_EQ(beside({key, nowhere}).borders_of(nowhere).occupied, 0);
}

TEST(TileNeighbors, AgreesWithAllPairs) {
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    std::vector<TileKey> tiles;
    for (int i = 0; i < 120; ++i) {
      const auto at = [&] { return static_cast<std::int32_t>(random() % 8) - 4; };
      tiles.push_back({at(), at(), at(), 0});
    }
    // Of one level, some twice: "within a cube of its size" is then "at its face".
    const TileNeighbors neighbors = beside(tiles);
    for (const TileKey& key : tiles) EXPECT_EQ(neighbors.borders_of(key).occupied, touching(key, tiles));
    // A larger tile is at the same faces as its parts.
    tiles = {{0, 0, 0, 1}};
    for (int i = 0; i < 8; ++i)
      tiles.push_back({2 + int(random() % 2), int(random() % 4) - 1, int(random() % 4) - 1, 0});
    for (std::size_t i = 1; i < tiles.size(); ++i)
      EXPECT_EQ(beside(tiles).borders_of(tiles[i]).occupied, touching(tiles[i], tiles));
  }
}

}  // namespace
}  // namespace mapcodec
