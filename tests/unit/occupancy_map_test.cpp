// SPDX-License-Identifier: GPL-3.0-or-later
// Octree files and archives of octrees.
#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "mapcodec/cloud/occupancy_edit.hpp"
#include "slam_adapter/octomap/occupancy_map.hpp"
#include "slam_adapter/verify.hpp"
#include "tests/unit/occupancy_support.hpp"

namespace mapcodec {
namespace {

using test::bubble;
using test::kAllKinds;

class OccupancyMaps : public testing::Test {
 protected:
  OccupancyMaps() {
    folder_ = std::filesystem::temp_directory_path() / ("mapcodec-octo-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  ~OccupancyMaps() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path(const char* name) const { return (folder_ / name).string(); }

  std::filesystem::path folder_;
};

Bytes file_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

OccupancyWrite small_tiles(Arena* arena = nullptr) {
  OccupancyWrite w;
  w.arena = arena;
  w.most_nodes = 100;
  return w;
}

TEST(OctreeFiles, BackAsTheyWere) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree tree = bubble(kind, 10);
    const OctreeFormat format = kind == OccupancyKind::binary ? OctreeFormat::bt : OctreeFormat::ot;
    const Bytes bytes = format_octree(tree, 0.05, format);
    const auto back = parse_octree(bytes);
    ASSERT_TRUE(back.ok()) << back.error().to_string();
    EXPECT_TRUE(back->tree == tree);
    EXPECT_EQ(back->resolution_m, 0.05);
    EXPECT_EQ(format_octree(back->tree, back->resolution_m, format), bytes);
  }
  const OccupancyTree color = bubble(OccupancyKind::color, 10);
  EXPECT_TRUE(parse_octree(format_octree(color, 0.3, OctreeFormat::bt)).value().tree == to_binary(color));
  EXPECT_EQ(parse_octree(format_octree(color, 1.0 / 3, OctreeFormat::ot)).value().resolution_m, 1.0 / 3);
}

TEST(OctreeFiles, OldHeaderAndChildlessNodes) {
  ByteWriter old;
  old.u32(3);
  old.f64(0.1);
  old.u32(4);
  old.u16(0x000D);  // free, inner
  old.u16(0x0008);  // of the inner one: an occupied second child
  const auto file = parse_octree(old.take());
  ASSERT_TRUE(file.ok()) << file.error().to_string();
  EXPECT_EQ(file->tree.leaf_count(), 2U);
  ByteWriter childless;
  childless.u32(3);
  childless.f64(0.1);
  childless.u32(3);
  childless.u16(0x000D);
  childless.u16(0);
  const auto leaf = parse_octree(childless.take());
  ASSERT_TRUE(leaf.ok()) << leaf.error().to_string();
  EXPECT_EQ(leaf->tree.levels[16].nodes, std::vector<std::uint16_t>{0x0005});
}

TEST(OctreeFiles, DamageIsNamed) {
  for (const OctreeFormat format : {OctreeFormat::bt, OctreeFormat::ot}) {
    const Bytes bytes = format_octree(bubble(OccupancyKind::color, 6), 0.05, format);
    for (std::size_t n = 0; n < bytes.size(); ++n)
      EXPECT_FALSE(parse_octree(ByteSpan(bytes).first(n)).ok()) << n;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      Bytes wrong = bytes;
      wrong[i] ^= 0xff;
      const auto parsed = parse_octree(wrong);
      if (parsed.ok()) {
        EXPECT_TRUE(parse_octree(format_octree(parsed->tree, 1, OctreeFormat::bt)).ok());
      }
    }
  }
  const auto says = [](const std::string& text) {
    const auto r = parse_octree(ByteSpan(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
    return r.ok() ? std::string("ok") : r.error().to_string();
  };
  const std::string head = "# Octomap OcTree binary file\n";
  EXPECT_NE(says(head + "id OcTreeStamped\nsize 2\nres 0.1\ndata\n").find("OcTreeStamped"),
            std::string::npos);
  EXPECT_NE(says(head + "id OcTree\nsize 2\nres -1\ndata\nxx").find("resolution"), std::string::npos);
  EXPECT_NE(says(head + "id OcTree\nsize 99\nres 1\ndata\n\x01\x00").find("fewer bytes"), std::string::npos);
  EXPECT_NE(says(head + "id OcTree\nsize 0\nres 1\ndata\n").find("no node"), std::string::npos);
  EXPECT_NE(says(head + "id OcTree\nsize 2\n").find("no end"), std::string::npos);
}

TEST_F(OccupancyMaps, SameBytesOnAnyThreadsAndBackExactly) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree tree = bubble(kind, 20);
    Arena two(2);
    auto write = small_tiles();
    write.overwrite = true;
    ASSERT_TRUE(create_occupancy_map(path("one.mapc"), tree, 0.1, write).ok());
    write.arena = &two;
    ASSERT_TRUE(create_occupancy_map(path("two.mapc"), tree, 0.1, write).ok());
    EXPECT_EQ(file_bytes(path("one.mapc")), file_bytes(path("two.mapc")));
    const auto map = OccupancyMap::open(path("one.mapc"));
    ASSERT_TRUE(map.ok());
    EXPECT_GT(map->file().summary().tiles, 10U);
    EXPECT_EQ(map->file().summary().points, tree.leaf_count());
    ReadSettings settings;
    settings.arena = &two;
    EXPECT_TRUE(map->read({}, settings).value() == tree);
    EXPECT_EQ(compare_occupancy_map(path("one.mapc"), {tree, 0.1, 0}, settings).value(), "");
    EXPECT_NE(compare_occupancy_map(path("one.mapc"), {bubble(kind, 19), 0.1, 0}, settings).value(), "");
    EXPECT_TRUE(verify_map(path("one.mapc"), settings).ok());
  }
}

TEST_F(OccupancyMaps, BoxReadsOnlyItsTiles) {
  const OccupancyTree tree = bubble(OccupancyKind::log_odds, 30);
  ASSERT_TRUE(create_occupancy_map(path("m.mapc"), tree, 0.1, small_tiles()).ok());
  const auto map = OccupancyMap::open(path("m.mapc"));
  ASSERT_TRUE(map.ok());
  Region region;
  region.box = Box{{1.01, 1.01, 1.01}, {2.55, 2.55, 2.55}};
  EXPECT_LT(map->tiles_in(region).size(), map->file().archive().tiles().size() / 2);
  const OccupancyTree part = map->read(region).value();
  const OccupancyIndex all(tree), some(part);
  for (std::uint32_t x = 32740; x < 32800; ++x) {
    const CellCorner v{x, 32780, 32785};
    const bool inside = x >= 32778 && x <= 32793;
    if (!inside) continue;
    const OccupancyCell want = all.find(v), have = some.find(v);
    EXPECT_EQ(have.cell, want.cell) << x;
    EXPECT_EQ(have.height, want.height) << x;
    if (want.cell != Cell::unknown) {
      EXPECT_EQ(some.value(have), all.value(want));
    }
  }
  EXPECT_LT(part.leaf_count(), tree.leaf_count() / 2);
  region.box = Box{{100, 100, 100}, {101, 101, 101}};
  EXPECT_EQ(map->read(region).value().root, Cell::unknown);
}

TEST_F(OccupancyMaps, UpdateTouchesOnlyChangedTiles) {
  for (const OccupancyKind kind : kAllKinds) {
    const OccupancyTree base = bubble(kind, 20);
    auto write = small_tiles();
    write.overwrite = true;
    ASSERT_TRUE(create_occupancy_map(path("u.mapc"), base, 0.1, write).ok());
    const Bytes before = file_bytes(path("u.mapc"));
    const auto same = update_occupancy_map(path("u.mapc"), base, 0.1, write);
    ASSERT_TRUE(same.ok()) << same.error().to_string();
    EXPECT_FALSE(same->committed);
    EXPECT_EQ(file_bytes(path("u.mapc")), before);

    const auto top = clip(bubble(kind, 21, 3), {0, 0, 0}, [](const CellCorner& c, unsigned h) {
      return c[0] < 32760 && c[0] + (1u << h) > 32750;
    });
    const auto report = update_occupancy_map(path("u.mapc"), top, 0.1, write);
    ASSERT_TRUE(report.ok()) << report.error().to_string();
    EXPECT_TRUE(report->committed);
    EXPECT_EQ(report->revision, 2U);
    const auto old = OccupancyMap::open(path("u.mapc"), 1), now = OccupancyMap::open(path("u.mapc"));
    EXPECT_TRUE(old->read().value() == base);
    EXPECT_TRUE(now->read().value() == overlay(base, top));
    std::size_t kept = 0;
    for (const TileRecord& t : now->file().archive().tiles()) {
      const auto i = old->file().archive().find(t.key);
      kept += i && old->file().archive().tiles()[*i].segments == t.segments ? 1 : 0;
    }
    EXPECT_GT(kept, now->file().archive().tiles().size() / 3);
    EXPECT_GE(kept + report->tiles_touched, now->file().archive().tiles().size());
  }
}

TEST_F(OccupancyMaps, ChangedKeysBringTheMapUpToTheTree) {
  const OccupancyTree base = bubble(OccupancyKind::log_odds, 20);
  ASSERT_TRUE(create_occupancy_map(path("k.mapc"), base, 0.1, small_tiles()).ok());
  const CellCorner voxel{32770, 32770, 32770}, far{40000, 40000, 40000};
  OccupancyTree point =
      clip(bubble(OccupancyKind::log_odds, 3, 9), {0, 0, 0}, [&](const CellCorner& c, unsigned h) {
        return c[0] >> h << h <= 32768 && c[0] + (1u << h) > 32768 && c[1] + (1u << h) > 32768 &&
               c[1] <= 32768 && c[2] <= 32768 && c[2] + (1u << h) > 32768;
      });
  const OccupancyTree now = overlay(base, point);
  const std::vector<CellCorner> elsewhere{far}, changed{{32768, 32768, 32768}, voxel};
  EXPECT_FALSE(update_occupancy_map(path("k.mapc"), now, 0.1, small_tiles(), &elsewhere)->committed);
  const auto report = update_occupancy_map(path("k.mapc"), now, 0.1, small_tiles(), &changed);
  ASSERT_TRUE(report.ok()) << report.error().to_string();
  EXPECT_TRUE(OccupancyMap::open(path("k.mapc"))->read().value() == now);
}

TEST_F(OccupancyMaps, WrongKindsAreRefused) {
  ASSERT_TRUE(
      create_occupancy_map(path("w.mapc"), bubble(OccupancyKind::log_odds, 5), 0.1, small_tiles()).ok());
  EXPECT_EQ(
      update_occupancy_map(path("w.mapc"), bubble(OccupancyKind::color, 5), 0.1, small_tiles()).error().code,
      ErrorCode::kInvalidArgument);
  EXPECT_EQ(update_occupancy_map(path("w.mapc"), bubble(OccupancyKind::log_odds, 5), 0.2, small_tiles())
                .error()
                .code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(create_occupancy_map(path("e.mapc"), OccupancyTree{}, 0.1, small_tiles()).error().code,
            ErrorCode::kEmpty);
  EXPECT_FALSE(std::filesystem::exists(path("e.mapc")));
}

}  // namespace
}  // namespace mapcodec
