// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "mapcodec/entropy/integer_model.hpp"
#include "mapcodec/entropy/logistic_mixer.hpp"

namespace mapcodec {
namespace {

TEST(RangeCoder, BitsRawAndModelledRoundTrip) {
  for (std::uint32_t seed = 0; seed < 50; ++seed) {
    std::mt19937_64 rng(seed), same(seed);
    RangeEncoder out;
    BitModel model;
    for (int i = 0; i < 2000; ++i) {
      out.encode(rng() % 9 == 0, model);
      const bool bit = rng() % 2 == 0;
      out.encode(bit, 1 + static_cast<std::uint32_t>(rng() % 65535));
      const int count = static_cast<int>(rng() % 65);
      out.encode_raw(rng(), count);
    }
    const Bytes bytes = out.finish();
    RangeDecoder in(bytes);
    BitModel twin;
    for (int i = 0; i < 2000; ++i) {
      ASSERT_EQ(in.decode(twin), same() % 9 == 0);
      const bool bit = same() % 2 == 0;
      ASSERT_EQ(in.decode(1 + static_cast<std::uint32_t>(same() % 65535)), bit);
      const int count = static_cast<int>(same() % 65);
      const std::uint64_t v = same();
      ASSERT_EQ(in.decode_raw(count), count == 64 ? v : v & ((std::uint64_t{1} << count) - 1));
    }
    EXPECT_TRUE(in.ok());
  }
}

TEST(RangeCoder, CarriesRunThroughWrittenBytes) {
  // The least probable upper parts push low towards its top, again and again.
  RangeEncoder out;
  for (int i = 0; i < 4000; ++i) out.encode(i % 3 != 0, i % 7 == 0 ? 65535 : 1);
  const Bytes bytes = out.finish();
  RangeDecoder in(bytes);
  for (int i = 0; i < 4000; ++i) ASSERT_EQ(in.decode(i % 7 == 0 ? 65535 : 1), i % 3 != 0);
}

TEST(RangeCoder, EndsWithinADozenBytesOfTheEnd) {
  RangeDecoder in({});
  int n = 0;
  while (in.ok() && n < 1000000) {
    in.decode_raw(8);
    ++n;
  }
  EXPECT_LT(n, 100);
}

TEST(RangeCoder, NearTheEntropy) {
  std::mt19937 rng(1);
  RangeEncoder out;
  BitModel model;
  for (int i = 0; i < 100000; ++i) out.encode(rng() % 100 < 5, model);
  const double entropy = -(0.05 * std::log2(0.05) + 0.95 * std::log2(0.95)) * 100000 / 8;
  EXPECT_LT(static_cast<double>(out.finish().size()), 1.03 * entropy);
}

TEST(BitModel, StaysWithinItsBounds) {
  for (const bool bit : {false, true}) {
    BitModel model;
    for (int i = 0; i < 100000; ++i) model.update(bit);
    EXPECT_GE(model.probability(), kMinProbability);
    EXPECT_LE(model.probability(), 65536 - kMinProbability);
    EXPECT_EQ(model.probability() > 65000, bit);
    EXPECT_EQ(model.probability() < 500, !bit);
  }
}

TEST(IntegerModel, EveryLengthRoundTrips) {
  RangeEncoder out;
  IntegerModel model;
  std::vector<std::uint64_t> values{0};
  for (int length = 0; length < 64; ++length) {
    for (const std::uint64_t v : {std::uint64_t{1} << length, (std::uint64_t{2} << length) - 1})
      values.push_back(v);
  }
  for (const std::uint64_t v : values) model.encode(out, v);
  for (const std::uint64_t v : values) model.encode_signed(out, unzigzag(v));
  const Bytes bytes = out.finish();
  RangeDecoder in(bytes);
  IntegerModel twin;
  for (const std::uint64_t v : values) EXPECT_EQ(twin.decode(in), v);
  for (const std::uint64_t v : values) EXPECT_EQ(twin.decode_signed(in), unzigzag(v));
  EXPECT_TRUE(in.ok());
}

TEST(LogisticMixer, TablesFollowTheirFormulas) {
  for (int i = 0; i < 4096; ++i) {
    const double logit = std::round(256 * std::log((i + 0.5) / (4095.5 - i)));
    EXPECT_EQ(logistic::kStretch[i], std::max(-2047.0, std::min(2047.0, logit))) << i;
    const double p = std::floor(65536 / (1 + std::exp((2048 - i) / 256.0)) + 0.5);
    EXPECT_EQ(logistic::kSquash[i], std::max(32.0, std::min(65504.0, p))) << i;
  }
}

TEST(LogisticMixer, LearnsWhichInputKnows) {
  std::mt19937 rng(3);
  LogisticMixer mixer;
  BitModel knows[2], guesses;
  double bits = 0;
  for (int i = 0; i < 20000; ++i) {
    const bool bit = rng() % 2 == 0;
    const auto mixed = mixer.predict(knows[bit], guesses, guesses);
    bits -= std::log2((bit ? mixed.probability : 65536 - mixed.probability) / 65536.0);
    mixer.update(mixed, bit);
    knows[bit].update(bit);
    guesses.update(bit);
  }
  EXPECT_LT(bits / 20000, 0.02);
}

TEST(LogisticMixer, OfFiveInputsToo) {
  std::mt19937 rng(3);
  LogisticMixerOf<5, 15> mixer;
  BitModel guesses[4], knows[2];
  double bits = 0;
  for (int i = 0; i < 5000; ++i) {
    const bool bit = rng() % 2 == 0;
    const auto mixed = mixer.predict(guesses[0], guesses[1], guesses[2], guesses[3], knows[bit]);
    bits -= std::log2((bit ? mixed.probability : 65536 - mixed.probability) / 65536.0);
    mixer.update(mixed, bit);
    knows[bit].update(bit);
    for (BitModel& g : guesses) g.update(bit);
  }
  EXPECT_LT(bits / 5000, 0.05);
}

}  // namespace
}  // namespace mapcodec
