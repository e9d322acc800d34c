// SPDX-License-Identifier: GPL-3.0-or-later
// Names of maps, rights, bearer tokens, secrets.
#include <gtest/gtest.h>

#include <set>

#include "maps/service/map_service.hpp"
#include "maps/service/token_access.hpp"
#include "maps/service/token_secret.hpp"

namespace mapcodec {
namespace {

TEST(MapName, TakesPlainOnes) {
  for (const char* name : {"a", "floor-2", "Halle_7.west", "0", "_x", "a.b.c"})
    EXPECT_TRUE(is_map_name(name)) << name;
}

TEST(MapName, RefusesPathTricks) {
  for (const char* name : {"", ".", "..", "../etc", "a/b", "/a", "a\\b", "a/../b", ".hidden", "-rf", "a b",
                           "a\n", "%2e", "a\xc3\xa4", "*", "a:b", "~", "$HOME", "a\x7f"}) {
    EXPECT_FALSE(is_map_name(name)) << name;
  }
  EXPECT_FALSE(is_map_name(std::string("a\0b", 3)));
  EXPECT_FALSE(is_map_name(std::string(101, 'x')));
  EXPECT_FALSE(is_map_name(std::string(1 << 20, 'x')));
}

TEST(PeerAddress, LosesItsPort) {
  EXPECT_EQ(peer_address("ipv4:10.0.0.7:4711"), "10.0.0.7");
  EXPECT_EQ(peer_address("ipv6:[::1]:4711"), "[::1]");
  EXPECT_EQ(peer_address("unix:"), "unix");
  EXPECT_EQ(peer_address("unix:/run/m.sock"), "unix");
  EXPECT_EQ(peer_address(""), "");
}

TEST(Rights, WordsGoBothWays) {
  for (const Right right : {Right::read, Right::write, Right::admin})
    EXPECT_EQ(parse_right(right_name(right)), right);
  for (const char* word : {"", "Read", "root", "read "}) EXPECT_FALSE(parse_right(word));
}

TEST(BearerToken, IsFoundInTheHeader) {
  EXPECT_EQ(bearer_token("Bearer abc"), "abc");
  EXPECT_EQ(bearer_token("bearer   abc"), "abc");
  for (const char* other : {"", "Bearer", "Bearer ", "Bearer    ", "Basic abc", "abc", "Bearerabc"}) {
    EXPECT_EQ(bearer_token(other), "") << other;
  }
}

TEST(TokenSecret, IsLongAndNew) {
  std::set<std::string> seen;
  for (int i = 0; i < 100; ++i) {
    const auto secret = make_token_secret();
    ASSERT_TRUE(secret.ok());
    EXPECT_EQ(secret->size(), 47u);
    EXPECT_EQ(secret->substr(0, 4), "mct_");
    EXPECT_TRUE(seen.insert(*secret).second);
  }
}

TEST(TokenSecret, HashIsSha256) {
  const auto hash = hash_token("abc");  // FIPS 180-2, B.1
  ASSERT_TRUE(hash.ok());
  EXPECT_EQ((*hash)[0], 0xba);
  EXPECT_EQ((*hash)[1], 0x78);
  EXPECT_EQ((*hash)[31], 0xad);
}

}  // namespace
}  // namespace mapcodec
