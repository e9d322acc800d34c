// SPDX-License-Identifier: GPL-3.0-or-later
// Conditions, ranges, names of tiles, ids of requests.
#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "tools/mapcodecd/http/conditional.hpp"
#include "tools/mapcodecd/http/http_answer.hpp"
#include "tools/mapcodecd/http/tile_path.hpp"
#include "tools/mapcodecd/request_record.hpp"

namespace mapcodec::daemon {
namespace {

TEST(Conditional, EntityTags) {
  EXPECT_TRUE(matches_etag("\"abc\"", "\"abc\""));
  EXPECT_TRUE(matches_etag("\"x\", W/\"abc\" ,\"y\"", "\"abc\""));
  EXPECT_TRUE(matches_etag("*", "\"abc\""));
  for (const char* other : {"", ",", ",,,", "abc", "\"ab\"", "\"abcd\"", "W/", "\"x\",\"y\""}) {
    EXPECT_FALSE(matches_etag(other, "\"abc\"")) << other;
  }
}

void expect_part(const char* header, std::uint64_t size, std::uint64_t offset, std::uint64_t length) {
  const ByteRange range = parse_range(header, size);
  EXPECT_EQ(range.kind, ByteRange::Kind::part) << header;
  EXPECT_EQ(range.offset, offset) << header;
  EXPECT_EQ(range.length, length) << header;
}

TEST(Conditional, Ranges) {
  expect_part("bytes=0-0", 100, 0, 1);
  expect_part("bytes=0-99", 100, 0, 100);
  expect_part("bytes=10-", 100, 10, 90);
  expect_part("bytes=-10", 100, 90, 10);
  expect_part("bytes=-1000", 100, 0, 100);
  expect_part("bytes=90-1000000", 100, 90, 10);
  expect_part("bytes=90-18446744073709551615", 100, 90, 10);
  for (const char* header : {"bytes=100-", "bytes=100-200", "bytes=-0"}) {
    EXPECT_EQ(parse_range(header, 100).kind, ByteRange::Kind::unsatisfiable) << header;
  }
  EXPECT_EQ(parse_range("bytes=0-", 0).kind, ByteRange::Kind::unsatisfiable);
  for (const char* header :
       {"", "bytes", "bytes=", "bytes=-", "bytes=5", "bytes=5-2", "bytes=a-b", "bytes=0-1,5-6", "lines=0-1",
        "bytes=0x1-2", "bytes=+1-2", "bytes=1-18446744073709551616"}) {
    EXPECT_EQ(parse_range(header, 100).kind, ByteRange::Kind::whole) << header;
  }
}

TEST(Conditional, AnswersAreCutAcrossSegments) {
  HttpAnswer answer;
  for (const char* text : {"abc", "", "defg", "h"}) answer.body.push_back(shared_text(text));
  HttpQuestion question;
  question.range = "bytes=2-4";
  apply_conditions(question, "\"t\"", answer);
  EXPECT_EQ(answer.status, 206);
  std::string text;
  for (const SharedBytes& part : answer.body) text += part.bytes;
  EXPECT_EQ(text, "cde");
  EXPECT_EQ(answer.size(), 3u);
}

TEST(TilePath, GoesBothWays) {
  constexpr auto kLeast = std::numeric_limits<std::int32_t>::min(),
                 kMost = std::numeric_limits<std::int32_t>::max();
  for (const TileSelection::Key& key :
       {TileSelection::Key{0, {0, 0, 0, 0}}, TileSelection::Key{0, {-1, 2, -3, 30}},
        TileSelection::Key{7, {kLeast, kMost, 0, 3}}, TileSelection::Key{4294967295u, TileKey::unplaced()}}) {
    const auto back = parse_tile_path(tile_path(key));
    ASSERT_TRUE(back.has_value()) << tile_path(key);
    EXPECT_EQ(back->key, key.key);
    EXPECT_EQ(back->submap, key.submap);
  }
  EXPECT_EQ(tile_path({0, {-1, 2, -3, 4}}), "4_-1_2_-3");
}

TEST(TilePath, RefusesOthers) {
  for (const char* text : {"",
                           "_",
                           "0",
                           "0_0_0",
                           "0_0_0_",
                           "_0_0_0_0",
                           "0_0_0_0_0",
                           "0_0_0_0_0_0",
                           "0__0_0_0",
                           "00_0_0_0",
                           "0_-0_0_0",
                           "0_0_0_2147483648",
                           "256_0_0_0",
                           "-1_0_0_0",
                           "0_0_0_0x",
                           " 0_0_0_0",
                           "0_0_0_+1",
                           "0_0_0_99999999999999999999",
                           "../../etc/passwd",
                           "0_0_0_0/.."}) {
    EXPECT_FALSE(parse_tile_path(text)) << text;
  }
  EXPECT_FALSE(parse_tile_path(std::string(1 << 20, '0')));
}

TEST(RequestId, KeepsPlainOnesAndMakesNewOnes) {
  EXPECT_EQ(request_id("robot-7.scan:12_a"), "robot-7.scan:12_a");
  std::set<std::string> seen;
  for (const std::string& odd :
       {std::string(), std::string("a b"), std::string("a\nb"), std::string("\"}"), std::string(65, 'x')}) {
    const std::string id = request_id(odd);
    EXPECT_EQ(id.size(), 16u);
    EXPECT_EQ(id.find_first_not_of("0123456789abcdef"), id.npos);
    EXPECT_TRUE(seen.insert(id).second);
  }
}

}  // namespace
}  // namespace mapcodec::daemon
