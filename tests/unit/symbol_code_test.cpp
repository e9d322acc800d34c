// SPDX-License-Identifier: GPL-3.0-or-later
// The code of symbols of sixteen: what was written comes back, parts never vanish, damage shows.
#include <gtest/gtest.h>

#include <random>

#include "mapcodec/entropy/rans_decoder.hpp"
#include "mapcodec/entropy/rans_encoder.hpp"

namespace mapcodec {
namespace {

/// What is coded: symbols in one or two models, bits, raw bits, in turns.
struct Message {
  std::vector<std::uint32_t> values;

  static Message random(std::size_t count, unsigned seed) {
    std::mt19937 r(seed);
    Message m;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t limits[4] = {16, 16, 2, 1u << (i % 17)};
      // Skewed, so that models learn something.
      m.values.push_back(static_cast<std::uint32_t>((std::uint64_t{r()} * r() >> 32) * limits[i % 4] >> 32));
    }
    return m;
  }
};

struct Models {
  NibbleModel one, a, b;
  BitModel bit;
};

Bytes encode(const Message& m) {
  RansEncoder out;
  Models models;
  for (std::size_t i = 0; i < m.values.size(); ++i) {
    const std::uint32_t v = m.values[i];
    if (i % 4 == 0) out.encode(v, models.one);
    if (i % 4 == 1) out.encode(v, models.a, models.b);
    if (i % 4 == 2) out.encode(v != 0, models.bit);
    if (i % 4 == 3) out.encode_raw(v, static_cast<int>(i % 17));
  }
  return out.finish();
}

/// Whether the code ended where it should.
bool decode(ByteSpan bytes, std::size_t count, Message& m) {
  RansDecoder in(bytes);
  Models models;
  for (std::size_t i = 0; i < count; ++i) {
    if (i % 4 == 0) m.values.push_back(in.decode(models.one));
    if (i % 4 == 1) m.values.push_back(in.decode(models.a, models.b));
    if (i % 4 == 2) m.values.push_back(in.decode(models.bit) ? 1 : 0);
    if (i % 4 == 3) m.values.push_back(in.decode_raw(static_cast<int>(i % 17)));
  }
  return in.finished();
}

TEST(SymbolCode, ComesBack) {
  for (const std::size_t count : {0u, 1u, 2u, 7u, 100u, 20000u}) {
    const Message m = Message::random(count, 1);
    Message back;
    EXPECT_TRUE(decode(encode(m), count, back)) << count;
    EXPECT_EQ(back.values, m.values);
  }
}

TEST(SymbolCode, DamageShowsAtTheEnd) {
  const Message m = Message::random(400, 2);
  const Bytes bytes = encode(m);
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    Message back;
    EXPECT_FALSE(decode(ByteSpan(bytes).first(cut), m.values.size(), back)) << cut;
  }
  Bytes longer = bytes;
  longer.insert(longer.end(), {0, 0});
  Message back;
  EXPECT_FALSE(decode(longer, m.values.size(), back));
}

void expect_parts(const NibbleModel& m) {
  std::uint32_t next = 0;
  for (std::uint32_t s = 0; s < 16; ++s) {
    const NibblePart p = part_of(m.bounds(), s);
    ASSERT_EQ(p.start, next);
    ASSERT_GT(p.size, 0u);
    ASSERT_EQ(symbol_at(m.bounds(), p.start), s);
    ASSERT_EQ(symbol_at(m.bounds(), p.start + p.size - 1), s);
    next += p.size;
  }
  ASSERT_EQ(next, 32768u);
}

TEST(NibbleModel, PartsNeverVanish) {
  std::mt19937 r(3);
  const std::array<std::uint64_t, 3> weights{1, std::uint64_t{1} << 40, 0};
  for (NibbleModel m : {NibbleModel(), NibbleModel(weights, 2)}) {
    expect_parts(m);
    for (int run = 0; run < 60; ++run) {
      const std::uint32_t favourite = r() % 16;
      for (int i = 0; i < 200; ++i) {
        m.update(r() % 50 == 0 ? r() % 16 : favourite);
        expect_parts(m);
      }
      NibbleModel other;
      other.update(r() % 16);
      const NibbleBounds mean = mean_of(m.bounds(), other.bounds());
      for (std::uint32_t s = 0; s < 16; ++s) ASSERT_GT(part_of(mean, s).size, 0u);
    }
  }
}

TEST(NibbleModel, Learns) {
  NibbleModel m;
  for (int i = 0; i < 2000; ++i) m.update(5);
  EXPECT_GT(part_of(m.bounds(), 5).size, 32000u);
  const std::array<std::uint64_t, 2> weights{1, 3};
  const NibbleModel begun(weights, 2);
  EXPECT_NEAR(part_of(begun.bounds(), 1).size, 24576, 20);
}

}  // namespace
}  // namespace mapcodec
