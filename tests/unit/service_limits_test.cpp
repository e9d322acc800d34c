// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <thread>
#include <vector>

#include "maps/service/client_limits.hpp"

namespace mapcodec {
namespace {

using namespace std::chrono_literals;
using Refusal = ClientLimits::Refusal;
using Kind = ClientLimits::Kind;
const ClientLimits::Clock::time_point kStart{};

TEST(ClientLimits, WithoutSettingsEverythingPasses) {
  ClientLimits limits({});
  for (int i = 0; i < 10000; ++i) {
    auto admission = limits.admit("a", Kind::request, kStart);
    ASSERT_TRUE(admission.admitted());
    admission.ticket.charge(1u << 30, kStart);
  }
}

TEST(ClientLimits, RateHoldsAndRecovers) {
  ClientLimits limits({.requests_per_s = 10, .request_burst = 3});
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(limits.admit("a", Kind::request, kStart).admitted());
  const auto refused = limits.admit("a", Kind::request, kStart);
  EXPECT_EQ(refused.refusal, Refusal::rate);
  EXPECT_EQ(refused.retry_after, 100ms);
  EXPECT_TRUE(limits.admit("b", Kind::request, kStart).admitted());  // another client is not touched
  EXPECT_TRUE(limits.admit("a", Kind::request, kStart + 100ms).admitted());
  EXPECT_FALSE(limits.admit("a", Kind::request, kStart + 100ms).admitted());
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(limits.admit("a", Kind::request, kStart + 1h).admitted());
  EXPECT_FALSE(limits.admit("a", Kind::request, kStart + 1h)
                   .admitted());  // a long rest gives one burst, not an hour's worth
}

TEST(ClientLimits, BytesAreChargedAfterwards) {
  ClientLimits limits({.bytes_per_s = 1000, .byte_burst = 500});
  auto first = limits.admit("a", Kind::request, kStart);
  first.ticket.charge(2500, kStart);
  EXPECT_EQ(first.ticket.debt(kStart), 2s);
  const auto refused = limits.admit("a", Kind::request, kStart + 1s);
  EXPECT_EQ(refused.refusal, Refusal::bytes);
  EXPECT_EQ(refused.retry_after, 1s);
  EXPECT_TRUE(limits.admit("a", Kind::request, kStart + 2s).admitted());
}

TEST(ClientLimits, StreamsAreGivenBack) {
  ClientLimits limits({.open_streams = 2});
  auto one = limits.admit("a", Kind::stream, kStart);
  {
    auto two = limits.admit("a", Kind::stream, kStart);
    EXPECT_TRUE(two.admitted());
    EXPECT_EQ(limits.admit("a", Kind::stream, kStart).refusal, Refusal::streams);
  }
  auto again = limits.admit("a", Kind::stream, kStart);
  EXPECT_TRUE(again.admitted());
  ClientLimits::Ticket moved = std::move(again.ticket);
  EXPECT_FALSE(limits.admit("a", Kind::stream, kStart).admitted());
  moved = std::move(one.ticket);  // one of the two ends
  EXPECT_TRUE(limits.admit("a", Kind::stream, kStart).admitted());
}

TEST(ClientLimits, RemembersABoundedNumber) {
  ClientLimits limits({.requests_per_s = 1, .request_burst = 1, .clients = 100});
  auto open = limits.admit("stays", Kind::stream, kStart);
  for (int i = 0; i < 10000; ++i)
    EXPECT_TRUE(limits.admit(std::to_string(i), Kind::request, kStart).admitted());
  EXPECT_LE(limits.remembered_clients(), 100u);
  EXPECT_FALSE(limits.admit("stays", Kind::stream, kStart).admitted());
}

TEST(ClientLimits, ManyThreads) {
  ClientLimits limits({.requests_per_s = 1e9, .request_burst = 1e9, .open_streams = 4, .clients = 8});
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&limits, t] {
      for (int i = 0; i < 2000; ++i) {
        auto admission = limits.admit(std::to_string((i + t) % 16), Kind::stream);
        admission.ticket.charge(10);
      }
    });
  }
  threads.clear();
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(limits.admit(std::to_string(i), Kind::stream).admitted());
}

}  // namespace
}  // namespace mapcodec
