// SPDX-License-Identifier: GPL-3.0-or-later
// The daemon's configuration: defaults go out and come back, mistakes have a line and column; where it
// listens.
#include <gtest/gtest.h>

#include <algorithm>

#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/config/listen_address.hpp"

namespace mapcodec::daemon {
namespace {

std::string message(const std::string& text) {
  const auto settings = parse_config(text);
  return settings.ok() ? "" : settings.error().message;
}

TEST(DaemonConfig, DefaultsGoOutAndComeBack) {
  const std::string text = print_config({});
  const auto settings = parse_config(text);
  ASSERT_TRUE(settings.ok()) << settings.error().message;
  EXPECT_EQ(print_config(*settings), text);
}

TEST(DaemonConfig, EveryChangedValueComesBack) {
  DaemonSettings s;
  s.service.folder = "/srv/\"maps\"\\\n\x01\x7f ä";
  s.service.cache_bytes = 12345678901;
  s.service.commit_after_s = 0.1 + 0.2;
  s.grpc.listen = {"[::1]:0", "unix:/run/x.sock"};
  s.http.listen = {};
  s.grpc.tls = s.http.tls = {"a.pem", "b.pem", "c.pem"};
  s.grpc.insecure = s.http.insecure = true;
  s.access.tokens = TokenPolicy::required;
  s.access.limits = {1.5, 3, 1e9, 1e6, 7};
  s.retention.keep_last = 3;
  s.log = {"debug", true, false};
  const std::string text = print_config(s);
  const auto back = parse_config(text);
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_EQ(print_config(*back), text);
  EXPECT_EQ(back->service.folder, s.service.folder);
  EXPECT_EQ(back->service.commit_after_s, s.service.commit_after_s);
  EXPECT_EQ(back->http.tls.client_ca_file, "c.pem");
  EXPECT_TRUE(back->http.listen.empty());
}

TEST(DaemonConfig, MistakesHaveAPlace) {
  EXPECT_EQ(message("[storage]\nfoldr = \"x\"\n"), "unknown key 'storage.foldr' (line 2, column 9)");
  EXPECT_EQ(message("[storag]\nfolder = \"x\"\n"), "unknown section 'storag' (line 1, column 1)");
  EXPECT_EQ(message("folder = \"x\""), "unknown section 'folder' (line 1, column 10)");
  EXPECT_EQ(message("[grpc]\nlisten = \"127.0.0.1:1\""),
            "grpc.listen is a list of strings (line 2, column 10)");
  EXPECT_EQ(message("[grpc]\nlisten = [1]"), "grpc.listen is a string (line 2, column 11)");
  EXPECT_EQ(message("[http]\nworkers = 1.5"), "http.workers is a whole number (line 2, column 11)");
  EXPECT_EQ(message("[http]\nworkers = true"), "http.workers is a whole number (line 2, column 11)");
  EXPECT_EQ(message("[access]\ntokens = \"none\""),
            "access.tokens is \"remote\" or \"required\" (line 2, column 10)");
  EXPECT_EQ(message("storage = 5"), "storage is a table: [storage] (line 1, column 11)");
  EXPECT_NE(message("[http]\nworkers = "), "");
  EXPECT_NE(message("[http\n"), "");
  EXPECT_NE(message("\xff\xfe"), "");
}

TEST(DaemonConfig, NumbersHaveARange) {
  for (const char* text :
       {"[http]\nworkers = 0", "[http]\nworkers = -1", "[http]\nworkers = 99999999999",
        "[http]\nread_timeout_s = 0", "[http]\nread_timeout_s = nan", "[http]\nread_timeout_s = inf",
        "[compaction]\ndead_share = 1.5", "[compaction]\nkeep_last = 0", "[limits]\nrequests_per_s = -1.0",
        "[storage]\nmax_maps = 0"}) {
    EXPECT_NE(message(text).find("out of range"), std::string::npos) << text << ": " << message(text);
  }
  EXPECT_EQ(message("[http]\nread_timeout_s = 3"), "");  // a whole number is a number
}

TEST(DaemonConfig, ChecksWhatCanBeCheckedWithoutStarting) {
  const auto finds = [](const DaemonSettings& s, const std::string& words) {
    const auto findings = check_config(s);
    return std::any_of(findings.begin(), findings.end(),
                       [&](const std::string& f) { return f.find(words) != f.npos; });
  };
  DaemonSettings good;
  good.service.folder = testing::TempDir();
  EXPECT_TRUE(check_config(good).empty());
  EXPECT_TRUE(finds({}, "storage.folder: not given"));
  DaemonSettings s = good;
  s.service.folder = "/nowhere/at/all";
  EXPECT_TRUE(finds(s, "is no folder"));
  s = good;
  s.http.listen = {"0.0.0.0:80"};
  EXPECT_TRUE(finds(s, "http.listen: '0.0.0.0:80': would be plain text beyond loopback"));
  s.http.insecure = true;
  EXPECT_FALSE(finds(s, "plain text"));
  s = good;
  s.grpc.tls.certificate_file = "/nowhere.pem";
  EXPECT_TRUE(finds(s, "given together"));
  s.grpc.tls.key_file = "/nowhere.key";
  EXPECT_TRUE(finds(s, "'/nowhere.pem' cannot be read"));
  s = good;
  s.log.level = "loud";
  EXPECT_TRUE(finds(s, "log.level"));
}

TEST(ListenAddress, GoesBothWays) {
  for (const char* text :
       {"127.0.0.1:7311", "[::1]:0", "0.0.0.0:65535", "[fe80::1]:80", "unix:/run/x.sock"}) {
    const auto address = parse_listen_address(text);
    ASSERT_TRUE(address.ok()) << text;
    EXPECT_EQ(address->to_string(), text);
  }
  EXPECT_EQ(parse_listen_address("localhost:80")->to_string(), "127.0.0.1:80");
}

TEST(ListenAddress, RefusesOthers) {
  for (const char* text : {"", ":", ":80", "80", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1",
                           "127.0.0.1:8x", "example.com:80", "*:80", "::1:80", "[::1]", "[]:80",
                           "unix:", "unix:relative", "unix-abstract:x", "127.1:80"}) {
    EXPECT_FALSE(parse_listen_address(text).ok()) << text;
  }
  EXPECT_FALSE(parse_listen_address("unix:/" + std::string(200, 'x')).ok());
}

TEST(ListenAddress, PlainTextStaysHere) {
  const auto allowed = [](const char* text, bool tls, bool insecure) {
    return check_listen(*parse_listen_address(text), tls, insecure).ok();
  };
  for (const char* near : {"127.0.0.1:1", "127.9.9.9:1", "[::1]:1", "unix:/x"})
    EXPECT_TRUE(allowed(near, false, false)) << near;
  for (const char* far : {"0.0.0.0:1", "10.0.0.1:1", "[::]:1", "[::ffff:127.0.0.1]:1", "128.0.0.1:1"}) {
    EXPECT_FALSE(allowed(far, false, false)) << far;
    EXPECT_TRUE(allowed(far, true, false)) << far;
    EXPECT_TRUE(allowed(far, false, true)) << far;
  }
}

}  // namespace
}  // namespace mapcodec::daemon
