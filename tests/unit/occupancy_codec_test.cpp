// SPDX-License-Identifier: GPL-3.0-or-later
// Occupancy tiles: exact, cut anywhere, hostile bytes refused.
#include <gtest/gtest.h>

#include <limits>

#include "mapcodec/cloud/occupancy_edit.hpp"
#include "mapcodec/codec/occupancy_decoder.hpp"
#include "mapcodec/codec/occupancy_encoder.hpp"
#include "tests/unit/occupancy_support.hpp"

namespace mapcodec {
namespace {

using test::bubble;
using test::kAllKinds;

OccupancyPiece whole(const OccupancyTree& tree) {
  return {{0, 0, 0, tree.height}, tree};
}

void expect_exact(const OccupancyPiece& piece) {
  const EncodedTile tile = encode_occupancy_tile(piece, 0.1);
  EXPECT_EQ(tile.points, piece.tree.leaf_count());
  EXPECT_EQ(tile.bytes, encode_occupancy_tile(piece, 0.1).bytes);
  const auto back = decode_occupancy_tile(tile.bytes);
  ASSERT_TRUE(back.ok()) << back.error().to_string();
  EXPECT_EQ(back->key, piece.key);
  EXPECT_TRUE(back->tree == piece.tree);
}

OccupancyTree one_leaf(OccupancyKind kind, Cell cell) {
  OccupancyTree t;
  t.kind = kind;
  t.root = cell;
  if (kind != OccupancyKind::binary)
    t.levels[16].leaf_values = {std::bit_cast<std::uint32_t>(cell == Cell::free ? -1.0F : 2.0F)};
  if (kind == OccupancyKind::color) t.levels[16].leaf_colors = {{1, 2, 3}};
  return t;
}

TEST(Occupancy, ExactForAllKinds) {
  for (const OccupancyKind kind : kAllKinds) {
    expect_exact(whole(bubble(kind, 20)));
    expect_exact(whole(bubble(kind, 3)));
    for (const Cell cell : {Cell::free, Cell::occupied}) expect_exact(whole(one_leaf(kind, cell)));
  }
}

TEST(Occupancy, CutAndJoinedAgain) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree tree = bubble(kind, 20);
    for (const std::uint64_t most : {1u, 20u, 300u, 1000000u}) {
      std::vector<OccupancyExtra> extras;
      const auto pieces = cut_tree(tree, most, extras);
      EXPECT_TRUE(extras.empty());
      for (std::size_t i = 1; i < pieces.size(); ++i)
        EXPECT_TRUE(compare_morton(pieces[i - 1].key, pieces[i].key) < 0);
      const auto joined = join_pieces(pieces, extras);
      ASSERT_TRUE(joined.ok());
      EXPECT_TRUE(*joined == tree) << most;
      if (most == 300) {
        for (const OccupancyPiece& p : pieces) expect_exact(p);
      }
    }
  }
}

TEST(Occupancy, InnerNodesThatDisagreeAreKept) {
  OccupancyTree tree = bubble(OccupancyKind::color, 12);
  for (OccupancyLevel& l : tree.levels) {
    for (std::size_t i = 0; i < l.node_values.size(); i += 3) {
      l.node_values[i] = std::bit_cast<std::uint32_t>(0.125F);
      l.node_colors[i] = {9, 8, 7};
    }
  }
  expect_exact(whole(tree));
  std::vector<OccupancyExtra> extras;
  const auto pieces = cut_tree(tree, 50, extras);
  EXPECT_FALSE(extras.empty());
  for (const OccupancyPiece& p : pieces) expect_exact(p);
  EXPECT_TRUE(join_pieces(pieces, extras).value() == tree);
}

TEST(Occupancy, AnyFloatBits) {
  OccupancyTree tree = bubble(OccupancyKind::log_odds, 15);
  std::mt19937 random(5);
  const float odd[] = {-0.0F, 0.0F, std::numeric_limits<float>::infinity(),
                       std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::denorm_min()};
  std::size_t count = 0;
  for (unsigned h = 1; h <= 16; ++h) {  // more different values than a table holds
    std::size_t leaf = 0;
    for (std::uint16_t& node : tree.levels[h].nodes) {
      for (unsigned c = 0; c < 8; ++c) {
        const Cell cell = cell_of(node, c);
        if (cell == Cell::unknown || cell == Cell::inner) continue;
        const std::uint32_t bits = count % 9 == 0 ? std::bit_cast<std::uint32_t>(odd[random() % 5])
                                                  : static_cast<std::uint32_t>(random());
        ++count;
        tree.levels[h - 1].leaf_values[leaf++] = bits;
        node = static_cast<std::uint16_t>((node & ~(3u << (2 * c))) |
                                          static_cast<unsigned>(cell_of_value(bits)) << (2 * c));
      }
    }
  }
  EXPECT_GT(count, 8000U);
  expect_exact(whole(tree));
}

TEST(Occupancy, TilesAreClouds) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree tree = bubble(kind, 8);
    const MapSchema schema = occupancy_schema(kind, 0.25);
    EXPECT_EQ(occupancy_kind(read_schema(write_schema(schema)).value()), kind);
    const EncodedTile tile = encode_occupancy_tile(whole(tree), 0.25);
    const auto cloud = decode_tile(tile.bytes, schema);
    ASSERT_TRUE(cloud.ok()) << cloud.error().to_string();
    EXPECT_EQ(cloud->size(), tree.leaf_count());
    EXPECT_EQ(cloud->channels.size(), schema.channels.size());
    for (const Vec3& p : cloud->xyz) EXPECT_TRUE(tile.bounds.contains(p));
    MapSchema points;
    EXPECT_FALSE(decode_tile(tile.bytes, points).ok());
  }
}

TEST(Occupancy, OverlayReplacesWhatTheTopKnows) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree base = bubble(kind, 14), top = bubble(kind, 9, 2);
    EXPECT_TRUE(overlay(base, OccupancyTree{kind, 16, Cell::unknown, {}}) == base);
    EXPECT_TRUE(overlay(OccupancyTree{kind, 16, Cell::unknown, {}}, top) == top);
    EXPECT_TRUE(overlay(base, base) == base);
    const OccupancyTree both = overlay(base, top);
    const OccupancyIndex b(base), t(top), r(both);
    for (std::uint32_t x = 32750; x < 32790; ++x) {
      for (std::uint32_t y = 32750; y < 32790; y += 3) {
        const CellCorner v{x, y, 32765};
        const OccupancyCell want = t.find(v), under = b.find(v), have = r.find(v);
        const bool from_top = want.cell != Cell::unknown;
        EXPECT_EQ(have.cell, from_top ? want.cell : under.cell);
        if (have.cell == Cell::unknown) continue;
        EXPECT_EQ(r.value(have), from_top ? t.value(want) : b.value(under));
        EXPECT_EQ(r.color(have), from_top ? t.color(want) : b.color(under));
      }
    }
  }
}

TEST(Occupancy, EqualLeavesOfBothBecomeOne) {
  OccupancyTree base, top;
  base.root = top.root = Cell::inner;
  base.levels[16].nodes = {0x1555};  // seven free children
  top.levels[16].nodes = {0x4000};   // the eighth
  const OccupancyTree both = overlay(base, top);
  EXPECT_EQ(both.root, Cell::free);
  EXPECT_EQ(both.inner_count(), 0U);
}

TEST(Occupancy, ClipKeepsWholeLeaves) {
  const OccupancyTree tree = bubble(OccupancyKind::color, 14);
  const auto all = clip(tree, {0, 0, 0}, [](const CellCorner&, unsigned) { return true; });
  EXPECT_TRUE(all == tree);
  const auto half = clip(tree, {0, 0, 0}, [](const CellCorner& c, unsigned) { return c[0] < 32768; });
  EXPECT_GT(half.leaf_count(), tree.leaf_count() / 3);
  EXPECT_LT(half.leaf_count(), tree.leaf_count() * 2 / 3);
  expect_exact(whole(half));
  const auto none = clip(tree, {0, 0, 0}, [](const CellCorner&, unsigned) { return false; });
  EXPECT_EQ(none.root, Cell::unknown);
}

TEST(OccupancyDamage, CutAndFlipped) {
  for (const OccupancyKind kind : kAllKinds) {
    const Bytes bytes = encode_occupancy_tile(whole(bubble(kind, 5)), 0.1).bytes;
    for (std::size_t n = 0; n < bytes.size(); ++n) {
      const auto cut = decode_occupancy_tile(ByteSpan(bytes).first(n));
      if (n < bytes.size() / 2) {
        EXPECT_FALSE(cut.ok()) << n;
      }
    }
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      for (const std::uint8_t flip : {0x01, 0x10, 0x80, 0xff}) {
        Bytes wrong = bytes;
        wrong[i] ^= flip;
        const auto decoded = decode_occupancy_tile(wrong);
        if (decoded.ok()) {
          EXPECT_EQ(decode_occupancy_tile(encode_occupancy_tile(*decoded, 0.1).bytes).value().tree,
                    decoded->tree);
        }
      }
    }
  }
}

TEST(OccupancyDamage, LiesAboutCountsAreRefusedBeforeMemoryIsTaken) {
  ByteWriter out;
  out.u8(5);
  out.u8(0);
  out.varint(std::uint64_t{1} << 27);
  out.u8(1 | 3 << 2);
  out.u8(16);
  for (int d = 0; d < 3; ++d) out.varint(0);
  out.varint(std::uint64_t{1} << 27);
  const Bytes lie = out.take();
  const auto refused = decode_occupancy_tile(lie);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kLimitExceeded);
  DecodeLimits small;
  small.max_points = 100;
  const Bytes fine = encode_occupancy_tile(whole(bubble(OccupancyKind::binary, 10)), 0.1).bytes;
  EXPECT_EQ(decode_occupancy_tile(fine, small).error().code, ErrorCode::kLimitExceeded);
}

TEST(OccupancyDamage, TheFormBeforeSymbolsIsRefused) {
  for (const OccupancyKind kind : {OccupancyKind::log_odds, OccupancyKind::color}) {
    Bytes bytes = encode_occupancy_tile(whole(one_leaf(kind, Cell::occupied)), 0.1).bytes;
    bytes[3] ^= 32;  // after codec, flags and the number of points
    const auto refused = decode_occupancy_tile(bytes);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
  }
}

TEST(OccupancyDamage, CodesThatGoOnAreRefused) {
  for (const OccupancyKind kind : {OccupancyKind::log_odds, OccupancyKind::color}) {
    Bytes bytes = encode_occupancy_tile(whole(bubble(kind, 5)), 0.1).bytes;
    bytes.insert(bytes.end(), {0, 0});
    EXPECT_FALSE(decode_occupancy_tile(bytes).ok());
  }
}

TEST(OccupancyDamage, PiecesThatOverlapAreRefused) {
  std::vector<OccupancyExtra> extras;
  auto pieces = cut_tree(bubble(OccupancyKind::binary, 20), 100, extras);
  ASSERT_GT(pieces.size(), 3U);
  auto twice = pieces;
  twice.insert(twice.begin(), twice.front());
  EXPECT_FALSE(join_pieces(twice, {}).ok());
  std::swap(pieces[0], pieces[2]);
  EXPECT_FALSE(join_pieces(pieces, {}).ok());
}

}  // namespace
}  // namespace mapcodec
