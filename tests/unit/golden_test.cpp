// SPDX-License-Identifier: GPL-3.0-or-later
// Archives of earlier versions decode to the same points and channels, bit by bit
// (tests/golden/make_golden.py).
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "mapcodec/quality/multiset_hash.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec {
namespace {

std::filesystem::path golden_folder() {
  return std::filesystem::path(MAPCODEC_GOLDEN_FOLDER);
}

struct Expected {
  std::uint64_t points = 0;
  std::string hash;
};

/// What hashes.json says of each map as a whole; its indentation tells that from what it says of single
/// tiles.
std::map<std::string, Expected> read_expected() {
  std::ifstream file(golden_folder() / "hashes.json");
  std::map<std::string, Expected> r;
  const std::regex name("^ \"(\\w+)\": \\{$"), hash("^  \"multiset_hash\": \"([0-9a-f]{32})\",?$"),
      points("^  \"points\": (\\d+),?$");
  std::string current;
  std::smatch m;
  for (std::string line; std::getline(file, line);) {
    if (std::regex_match(line, m, name)) current = m[1];
    if (std::regex_match(line, m, hash)) r[current].hash = m[1];
    if (std::regex_match(line, m, points)) r[current].points = std::stoull(m[1]);
  }
  return r;
}

TEST(Golden, EveryArchiveIsListed) {
  const auto expected = read_expected();
  std::size_t archives = 0;
  for (const auto& entry : std::filesystem::directory_iterator(golden_folder())) {
    if (entry.path().extension() != ".mapc") continue;
    ++archives;
    EXPECT_TRUE(expected.contains(entry.path().stem().string())) << entry.path();
  }
  EXPECT_EQ(archives, expected.size());
  EXPECT_GE(archives, 20u);
}

TEST(Golden, DecodesAsBefore) {
  for (const auto& [name, expected] : read_expected()) {
    const Result<MapFile> map = MapFile::open((golden_folder() / (name + ".mapc")).string());
    ASSERT_TRUE(map) << name;
    const Result<PointCloud> cloud = map->read();
    ASSERT_TRUE(cloud) << name;
    EXPECT_EQ(cloud->size(), expected.points) << name;
    EXPECT_EQ(multiset_hash(*cloud).hex(), expected.hash) << name;
  }
}

}  // namespace
}  // namespace mapcodec
