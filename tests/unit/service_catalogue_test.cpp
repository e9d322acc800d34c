// SPDX-License-Identifier: GPL-3.0-or-later
// Tokens, maps and jobs in the catalogue; two processes' worth of connections; files that are no catalogue.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "maps/service/catalogue.hpp"
#include "maps/service/token_access.hpp"

namespace mapcodec {
namespace {

class CatalogueTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        testing::TempDir() + "catalogue_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path() const { return folder_ + "/catalogue.db"; }
  [[nodiscard]] std::unique_ptr<Catalogue> open(const Retention& defaults = {}) const {
    auto catalogue = Catalogue::open(path(), defaults);
    EXPECT_TRUE(catalogue.ok()) << catalogue.error().message;
    return std::move(catalogue).value();
  }
  std::string folder_;
};

TokenState access(const Catalogue& c, std::string_view secret, std::string_view map, Right right,
                  std::int64_t now_s = 100) {
  const auto decision = c.check(secret, map, right, now_s);
  EXPECT_TRUE(decision.ok());
  return decision->state;
}

TEST_F(CatalogueTest, TokenGivesItsRightsAndNoOthers) {
  const auto c_owner = open();
  Catalogue& c = *c_owner;
  const auto robot = c.add_token("robot", {{"yard", Right::write}, {"hall", Right::read}}, 10);
  const auto root = c.add_token("root", {{std::string(kEveryMap), Right::admin}}, 10);
  ASSERT_TRUE(robot.ok() && root.ok());
  EXPECT_EQ(access(c, *robot, "yard", Right::write), TokenState::granted);
  EXPECT_EQ(access(c, *robot, "yard", Right::read), TokenState::granted);
  EXPECT_EQ(access(c, *robot, "yard", Right::admin), TokenState::forbidden);
  EXPECT_EQ(access(c, *robot, "hall", Right::read), TokenState::granted);
  EXPECT_EQ(access(c, *robot, "hall", Right::write), TokenState::forbidden);
  EXPECT_EQ(access(c, *robot, "roof", Right::read), TokenState::forbidden);
  EXPECT_EQ(access(c, *robot, "", Right::read), TokenState::granted);
  EXPECT_EQ(access(c, *root, "roof", Right::admin), TokenState::granted);
  EXPECT_EQ(c.check(*robot, "yard", Right::read, 100)->token, "robot");
}

TEST_F(CatalogueTest, NoTokenWrongTokenExpiredToken) {
  const auto c_owner = open();
  Catalogue& c = *c_owner;
  const auto secret = c.add_token("a", {{"yard", Right::read}}, 10, 1000);
  ASSERT_TRUE(secret.ok());
  EXPECT_EQ(access(c, "", "yard", Right::read), TokenState::missing);
  EXPECT_EQ(access(c, "mct_nothing", "yard", Right::read), TokenState::unknown);
  EXPECT_EQ(access(c, *secret + "x", "yard", Right::read), TokenState::unknown);
  EXPECT_EQ(access(c, "' OR 1=1 --", "yard", Right::read), TokenState::unknown);
  EXPECT_EQ(access(c, *secret, "' OR 1=1 --", Right::read), TokenState::forbidden);
  EXPECT_EQ(access(c, *secret, "yard", Right::read, 999), TokenState::granted);
  EXPECT_EQ(access(c, *secret, "yard", Right::read, 1000), TokenState::expired);
}

TEST_F(CatalogueTest, RevokedTokenIsRefusedByOpenConnections) {
  const auto daemon_owner = open();
  Catalogue& daemon = *daemon_owner;
  const auto verb_owner = open();
  Catalogue& verb = *verb_owner;
  const auto secret = verb.add_token("a", {{"yard", Right::read}}, 10);
  ASSERT_TRUE(secret.ok());
  EXPECT_EQ(access(daemon, *secret, "yard", Right::read), TokenState::granted);
  ASSERT_TRUE(verb.revoke_token("a").ok());
  EXPECT_EQ(access(daemon, *secret, "yard", Right::read), TokenState::unknown);
  EXPECT_EQ(verb.revoke_token("a").error().code, ErrorCode::kNotFound);
}

TEST_F(CatalogueTest, ListsTokensWithoutTheirSecrets) {
  const auto c_owner = open();
  Catalogue& c = *c_owner;
  const auto secret = c.add_token("b", {{"yard", Right::write}, {"yard", Right::read}}, 10, 20);
  ASSERT_TRUE(secret.ok() && c.add_token("a", {{"*", Right::read}}, 11).ok());
  const auto tokens = c.tokens();
  ASSERT_TRUE(tokens.ok());
  ASSERT_EQ(tokens->size(), 2u);
  EXPECT_EQ((*tokens)[0].name, "a");
  EXPECT_EQ((*tokens)[1].grants, (std::vector<MapGrant>{{"yard", Right::write}}));
  EXPECT_EQ((*tokens)[1].expires_s, 20);
  EXPECT_TRUE((*tokens)[1].expired(20));
  for (const char* suffix : {"", "-wal"}) {  // nor does it lie in the file
    std::ifstream file(path() + suffix, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    EXPECT_EQ(bytes.find(*secret), bytes.npos);
  }
}

TEST_F(CatalogueTest, RefusesBadTokens) {
  const auto c_owner = open();
  Catalogue& c = *c_owner;
  const std::vector<MapGrant> good = {{"yard", Right::read}};
  ASSERT_TRUE(c.add_token("a", good, 10).ok());
  EXPECT_EQ(c.add_token("a", good, 10).error().code, ErrorCode::kExists);
  for (const std::string& name :
       {std::string(), std::string("a b"), std::string("a\n"), std::string(65, 'x')}) {
    EXPECT_EQ(c.add_token(name, good, 10).error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_EQ(c.add_token("b", {}, 10).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(c.add_token("b", {{"../yard", Right::read}}, 10).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(c.tokens()->size(), 1u);
}

TEST_F(CatalogueTest, IsForTheOwnerOnly) {
  const auto owner = open();
  for (const char* suffix : {"", "-wal", "-shm"}) {
    struct stat status {};
    ASSERT_EQ(stat((path() + suffix).c_str(), &status), 0) << suffix;
    EXPECT_EQ(status.st_mode & 0777, 0600u) << suffix;
  }
}

TEST_F(CatalogueTest, MapsAndTheirRetention) {
  const auto owner = open({.keep_last = 3});
  Catalogue& c = *owner;
  ASSERT_TRUE(c.created("yard", {5}, "robot").ok());
  ASSERT_TRUE(c.set_retention("hall", {11}).ok());
  ASSERT_TRUE(c.set_retention("yard", {7}).ok());
  EXPECT_EQ(c.created("../yard", {1}, "robot").error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(c.set_retention("yard", {0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(c.retention("yard")->keep_last, 7u);
  EXPECT_EQ(c.retention("roof")->keep_last, 3u);
  const auto maps = c.maps();
  ASSERT_TRUE(maps.ok());
  ASSERT_EQ(maps->size(), 2u);
  EXPECT_EQ((*maps)[0].name, "hall");
  EXPECT_EQ((*maps)[1].created_by, "robot");
}

TEST_F(CatalogueTest, RemovedMapTakesItsGrantsAlong) {
  const auto owner = open();
  Catalogue& c = *owner;
  ASSERT_TRUE(c.created("yard", {}, "robot").ok());
  const auto secret = c.add_token("a", {{"yard", Right::admin}}, 10);
  ASSERT_TRUE(c.job("yard", "compact", "begun").ok());
  ASSERT_TRUE(c.removed("yard").ok());
  EXPECT_EQ(access(c, *secret, "yard", Right::read), TokenState::forbidden);
  EXPECT_TRUE(c.jobs()->empty());
  EXPECT_TRUE(c.maps()->empty());
  EXPECT_TRUE(c.removed("yard").ok());
}

TEST_F(CatalogueTest, JobsAreRecorded) {
  const auto owner = open();
  Catalogue& c = *owner;
  ASSERT_TRUE(c.job("yard", "compact", "begun").ok());
  EXPECT_EQ(c.jobs()->front().state, Job::State::running);
  ASSERT_TRUE(c.job("yard", "compact", "done").ok());
  ASSERT_TRUE(c.job("hall", "compact", "begun").ok());
  ASSERT_TRUE(c.job("hall", "compact", "disk full").ok());
  const auto jobs = c.jobs();
  ASSERT_TRUE(jobs.ok());
  ASSERT_EQ(jobs->size(), 2u);
  EXPECT_EQ((*jobs)[0].outcome, "disk full");
  EXPECT_EQ((*jobs)[0].state, Job::State::failed);
  EXPECT_EQ((*jobs)[1].state, Job::State::done);
  EXPECT_GE((*jobs)[1].ended_s, (*jobs)[1].begun_s);
}

TEST_F(CatalogueTest, JobsOfADeadProcessAreMarked) {
  ASSERT_TRUE(open()->job("yard", "compact", "begun").ok());
  const auto owner = open();
  const auto marked = owner->mark_interrupted_jobs();
  ASSERT_TRUE(marked.ok());
  EXPECT_EQ(*marked, 1);
  EXPECT_EQ(owner->jobs()->front().state, Job::State::interrupted);
}

TEST_F(CatalogueTest, OldJobsAreForgotten) {
  const auto owner = open();
  for (int i = 0; i < 220; ++i) {
    ASSERT_TRUE(owner->job("yard", "compact", "begun").ok());
    ASSERT_TRUE(owner->job("yard", "compact", "done").ok());
  }
  const auto jobs = owner->jobs(5000);
  ASSERT_TRUE(jobs.ok());
  EXPECT_LE(jobs->size(), 201u);
  EXPECT_GE(jobs->size(), 200u);
}

TEST_F(CatalogueTest, RefusesOtherFiles) {
  std::ofstream(path()) << "this is no database, but long enough to hold a header of one hundred "
                           "bytes.........................";
  EXPECT_EQ(Catalogue::open(path()).error().code, ErrorCode::kMalformed);
  EXPECT_EQ(Catalogue::open(folder_ + "/missing/catalogue.db").error().code, ErrorCode::kCannotWrite);
  std::filesystem::create_symlink("/dev/null", folder_ + "/link.db");
  EXPECT_FALSE(Catalogue::open(folder_ + "/link.db").ok());
}

TEST_F(CatalogueTest, ManyThreadsAndConnections) {
  const auto a_owner = open();
  Catalogue& a = *a_owner;
  const auto b_owner = open();
  Catalogue& b = *b_owner;
  const auto secret = a.add_token("t", {{"*", Right::read}}, 1);
  ASSERT_TRUE(secret.ok());
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      Catalogue& c = t % 2 == 0 ? a : b;
      for (int i = 0; i < 50; ++i) {
        EXPECT_EQ(access(c, *secret, "yard", Right::read), TokenState::granted);
        EXPECT_TRUE(c.set_retention("m" + std::to_string(t), {std::uint64_t(i) + 1}).ok());
      }
    });
  }
  threads.clear();
  EXPECT_EQ(a.maps()->size(), 4u);
}

class TokenAccessTest : public CatalogueTest {};

TEST_F(TokenAccessTest, PolicyAndTokens) {
  const auto catalogue = open();
  const auto reader = catalogue->add_token("reader", {{"yard", Right::read}}, 10);
  ASSERT_TRUE(reader.ok());
  TokenAccess everybody(*catalogue, TokenPolicy::required, {});
  TokenAccess remote(*catalogue, TokenPolicy::remote, {});
  const Credentials far{"", "ipv4:10.0.0.7:1", "", false}, near{"", "unix:", "", true};
  const auto code = [](TokenAccess& access, Credentials who, const std::string& token, Right right) {
    who.token = token;
    const auto admission = access.admit(who, right, "yard", CallKind::unary);
    return admission.ok() ? std::optional<ErrorCode>() : admission.error().code;
  };
  for (TokenAccess* access : {&everybody, &remote}) {
    for (const Credentials& who : {far, near}) {
      EXPECT_EQ(code(*access, who, *reader, Right::read), std::nullopt);
      EXPECT_EQ(code(*access, who, *reader, Right::write), ErrorCode::kDenied);
      EXPECT_EQ(code(*access, who, "mct_wrong", Right::read), ErrorCode::kUnauthenticated);
    }
    EXPECT_EQ(code(*access, far, "", Right::read), ErrorCode::kUnauthenticated);
  }
  EXPECT_EQ(code(everybody, near, "", Right::read), ErrorCode::kUnauthenticated);
  EXPECT_EQ(code(remote, near, "", Right::admin), std::nullopt);
  EXPECT_TRUE(remote.may_read(near, "yard"));
  EXPECT_FALSE(remote.may_read(far, "yard"));
}

TEST_F(TokenAccessTest, LimitsAreThoseOfTheToken) {
  const auto catalogue = open();
  const auto a = catalogue->add_token("a", {{"*", Right::read}}, 10);
  const auto b = catalogue->add_token("b", {{"*", Right::read}}, 10);
  TokenAccess access(
      *catalogue, TokenPolicy::required,
      {.requests_per_s = 1e-3, .request_burst = 2, .bytes_per_s = 1e-3, .byte_burst = 10, .open_streams = 1});
  const auto admit = [&](const std::string& token, CallKind kind) {
    return access.admit({token, "ipv4:10.0.0.7:1", "", false}, Right::read, "yard", kind);
  };
  auto stream = admit(*a, CallKind::stream);
  ASSERT_TRUE(stream.ok());
  EXPECT_EQ((*stream)->principal(), "a");
  EXPECT_EQ(admit(*a, CallKind::stream).error().code, ErrorCode::kBusy);
  EXPECT_TRUE((*stream)->charge(1000).ok());
  EXPECT_EQ((*stream)->charge(1).error().code, ErrorCode::kBusy);
  EXPECT_TRUE(admit(*b, CallKind::unary).ok());
  EXPECT_TRUE(admit(*b, CallKind::unary).ok());
  EXPECT_EQ(admit(*b, CallKind::unary).error().code, ErrorCode::kBusy);
}

TEST_F(TokenAccessTest, GuessingIsLimited) {
  const auto catalogue = open();
  TokenAccess access(*catalogue, TokenPolicy::required, {.requests_per_s = 1e-3, .request_burst = 5});
  int unknown = 0, busy = 0;
  for (int i = 0; i < 20; ++i) {
    const auto admission =
        access.admit({"mct_" + std::to_string(i), "ipv4:10.0.0.7:" + std::to_string(i), "", false},
                     Right::read, "yard", CallKind::unary);
    ASSERT_FALSE(admission.ok());
    ++(admission.error().code == ErrorCode::kBusy ? busy : unknown);
  }
  EXPECT_EQ(unknown, 5);
  EXPECT_EQ(busy, 15);
}

}  // namespace
}  // namespace mapcodec
