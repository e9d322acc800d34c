// SPDX-License-Identifier: GPL-3.0-or-later
// The symbols of one split (FORMAT.md 8.5 and 8.6).
#pragma once

#include "mapcodec/attribute/color_walk.hpp"
#include "mapcodec/attribute/magnitude_model.hpp"
#include "mapcodec/entropy/logistic_mixer.hpp"

namespace mapcodec {

/// Contexts of settings that are not coarse.
struct ColorModels {
  std::array<BitModel, 16 * 6 * 4> any{};  ///< gain, around, above
  std::array<BitModel, 3 * 6 * 4> zero{};  ///< component, around, non-zero components before it
  std::array<std::array<MagnitudeModel, 6>, 3> magnitude{};  ///< |q| - 1: component, around
};

/// Contexts of coarse settings. Symbols are few: each bit is a mixture, so that what a context has not seen
/// yet another one knows. Slot: 4 * component + non-zero components before it (1: L, 2: M); length: bits of
/// |q| - 1 known so far.
struct CoarseColorModels {
  template <std::size_t kInputs>
  using Mixer = LogisticMixerOf<kInputs, 15>;
  static constexpr std::size_t kLengths = 8;  ///< longer magnitudes share the contexts of this length

  std::array<BitModel, 16 * 8> any_gain{};                        ///< gain, expected L
  std::array<BitModel, 16 * 12 * 8> any_busy{};                   ///< gain, busy, expected L
  std::array<BitModel, 16 * 12 * 8> any_contrast{};               ///< gain, contrast of L, here
  std::array<BitModel, 16 * 12 * 9> any_beside{};                 ///< gain, beside, handed
  std::array<BitModel, 16 * 12 * 12> any_diagonal{};              ///< gain, diagonal, ahead
  std::array<Mixer<5>, 16> any_mixer{};                           ///< gain
  std::array<BitModel, 12 * 6> zero_around{};                     ///< slot, around
  std::array<BitModel, 12 * 12 * 8> zero_contrast{};              ///< slot, contrast, expected
  std::array<BitModel, 12 * 16 * 8> zero_gain{};                  ///< slot, gain, here
  std::array<BitModel, 12 * 4 * 4 * 12> zero_before{};            ///< slot, sizes before, ahead
  std::array<Mixer<4>, 12> zero_mixer{};                          ///< slot
  std::array<BitModel, 3 * 8> sign_expected{};                    ///< component, expected
  std::array<BitModel, 3 * 2 * 9> sign_before{};                  ///< component, expected sign, signs before
  std::array<Mixer<2>, 3> sign_mixer{};                           ///< component
  std::array<BitModel, 3 * kLengths * 12> longer_busy{};          ///< component, length, busy
  std::array<BitModel, 3 * kLengths * 12 * 8> longer_contrast{};  ///< component, length, contrast, expected
  std::array<BitModel, 3 * kLengths * 16 * 4> longer_gain{};      ///< component, length, gain, before
  std::array<Mixer<3>, 3 * kLengths> longer_mixer{};              ///< component, length
  std::array<std::array<BitModel, 4>, 3 * kLengths> mantissa{};   ///< component, length; bits so far
};

using ColorSymbols = std::array<std::int64_t, 3>;

template <class Side>
ColorSymbols code_split(Side& side, ColorModels& m, const SplitContext& x, const ColorSymbols& q) {
  ColorSymbols r{};
  const bool nothing = q == ColorSymbols{};
  if (!side.bit(!nothing, m.any[(x.gain * 6 + x.around) * 4 + x.above])) return r;
  std::size_t before = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    // Both before were zero, so the last is not.
    const bool known = c == 2 && before == 0;
    if (!known && side.bit(q[c] == 0, m.zero[(c * 6 + x.around) * 4 + before])) continue;
    const bool negative = side.raw(q[c] < 0, 1) != 0;
    const auto asked = static_cast<std::uint64_t>(q[c] < 0 ? -q[c] : q[c]) - 1;
    const auto magnitude =
        static_cast<std::int64_t>(m.magnitude[c][x.around].code(side, asked) & 0xffffff) + 1;
    r[c] = negative ? -magnitude : magnitude;
    before |= std::size_t{1} << std::min<std::size_t>(c, 1);
  }
  return r;
}

/// @return whether the component is negative.
template <class Side>
bool code_coarse_sign(Side& side, CoarseColorModels& m, const SplitContext& x, std::size_t c,
                      const ColorSymbols& before, bool negative) {
  const auto sign = [](std::int64_t v) { return std::size_t{v > 0} + 2 * std::size_t{v < 0}; };
  const bool expected = x.predicted[c] < 0;
  BitModel& by_size = m.sign_expected[c * 8 + x.expected[c]];
  BitModel& by_signs = m.sign_before[((2 * c + expected) * 3 + sign(before[0])) * 3 + sign(before[1])];
  return code_mixed(side, negative != expected, m.sign_mixer[c], by_size, by_signs) != expected;
}

/// A number below 2^24: its bit length in unary, two bits below the leading one, the rest raw.
template <class Side>
std::uint64_t code_coarse_magnitude(Side& side, CoarseColorModels& m, const SplitContext& x, std::size_t c,
                                    std::size_t before, std::uint64_t v) {
  constexpr std::size_t kMostLength = 24, kModelledBits = 2;
  const auto asked = static_cast<std::size_t>(std::bit_width(v));
  std::size_t length = 0;
  for (; length < kMostLength; ++length) {
    const std::size_t at = c * m.kLengths + std::min(length, m.kLengths - 1);
    BitModel& by_contrast = m.longer_contrast[(at * 12 + x.contrast[c]) * 8 + x.expected[c]];
    if (!code_mixed(side, asked > length, m.longer_mixer[at], m.longer_busy[at * 12 + x.busy], by_contrast,
                    m.longer_gain[(at * 16 + x.gain) * 4 + before]))
      break;
  }
  if (length < 2) return length;
  const std::size_t modelled = std::min(length - 1, kModelledBits);
  std::array<BitModel, 4>& tree = m.mantissa[c * m.kLengths + std::min(length, m.kLengths) - 1];
  std::uint64_t r = 1;
  for (std::size_t i = 0; i < modelled; ++i)
    r = r * 2 + side.bit(((v >> (length - 2 - i)) & 1) != 0, tree[r]);
  const int raw = static_cast<int>(length - 1 - modelled);
  return raw > 0 ? (r << raw) | side.raw(v & ((std::uint64_t{1} << raw) - 1), raw) : r;
}

template <class Side>
ColorSymbols code_split(Side& side, CoarseColorModels& m, const SplitContext& x, const ColorSymbols& q) {
  ColorSymbols r{};
  const bool nothing = q == ColorSymbols{};
  if (!code_mixed(side, !nothing, m.any_mixer[x.gain], m.any_gain[x.gain * 8 + x.expected[0]],
                  m.any_busy[(x.gain * 12 + x.busy) * 8 + x.expected[0]],
                  m.any_contrast[(x.gain * 12 + x.contrast[0]) * 8 + x.here],
                  m.any_beside[(x.gain * 12 + x.beside) * 9 + x.handed],
                  m.any_diagonal[(x.gain * 12 + x.diagonal) * 12 + x.ahead]))
    return r;
  const auto size = [](std::int64_t v) {
    return std::min<std::size_t>(static_cast<std::size_t>(v < 0 ? -v : v), 3);
  };
  std::size_t before = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t slot = 4 * c + before;
    // Both before were zero, so the last is not.
    const bool known = c == 2 && before == 0;
    if (!known && code_mixed(side, q[c] == 0, m.zero_mixer[slot], m.zero_around[slot * 6 + x.around],
                             m.zero_contrast[(slot * 12 + x.contrast[c]) * 8 + x.expected[c]],
                             m.zero_gain[(slot * 16 + x.gain) * 8 + x.here],
                             m.zero_before[((slot * 4 + size(r[0])) * 4 + size(r[1])) * 12 + x.ahead]))
      continue;
    const bool negative = code_coarse_sign(side, m, x, c, r, q[c] < 0);
    const auto asked = static_cast<std::uint64_t>(q[c] < 0 ? -q[c] : q[c]) - 1;
    const auto magnitude = static_cast<std::int64_t>(code_coarse_magnitude(side, m, x, c, before, asked)) + 1;
    r[c] = negative ? -magnitude : magnitude;
    before |= std::size_t{1} << std::min<std::size_t>(c, 1);
  }
  return r;
}

}  // namespace mapcodec
