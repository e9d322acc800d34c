// SPDX-License-Identifier: GPL-3.0-or-later
// The symbols of one split (FORMAT.md 8.5).
#pragma once

#include "mapcodec/attribute/color_walk.hpp"
#include "mapcodec/attribute/magnitude_model.hpp"

namespace mapcodec {

struct ColorModels {
  std::array<BitModel, 16 * 6 * 4> any{};          ///< gain, around, above
  std::array<BitModel, 16 * 12 * 8> any_coarse{};  ///< gain, busy, expected size of the first component
  std::array<BitModel, 3 * 8> against{};           ///< component, expected size: sign is not the expected one
  std::array<BitModel, 3 * 6 * 4> zero{};          ///< component, around, non-zero components before it
  std::array<std::array<MagnitudeModel, 6>, 3> magnitude{};  ///< |q| - 1: component, around
};

template <class Side>
bool code_sign(Side& side, ColorModels& m, const SplitContext& x, std::size_t c, bool negative) {
  if (!x.coarse) return side.raw(negative, 1) != 0;
  const bool expected = x.expected_negative[c];
  return side.bit(negative != expected, m.against[c * 8 + x.expected[c]]) != expected;
}

template <class Side>
std::array<std::int64_t, 3> code_split(Side& side, ColorModels& m, const SplitContext& x,
                                       const std::array<std::int64_t, 3>& q) {
  std::array<std::int64_t, 3> r{};
  const bool nothing = q[0] == 0 && q[1] == 0 && q[2] == 0;
  BitModel& any = x.coarse ? m.any_coarse[(x.gain * 12 + x.busy) * 8 + x.expected[0]]
                           : m.any[(x.gain * 6 + x.around) * 4 + x.above];
  if (!side.bit(!nothing, any)) return r;
  std::size_t before = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    // Both before were zero, so the last is not.
    const bool known = c == 2 && before == 0;
    if (!known && side.bit(q[c] == 0, m.zero[(c * 6 + x.around) * 4 + before])) continue;
    const bool negative = code_sign(side, m, x, c, q[c] < 0);
    const auto asked = static_cast<std::uint64_t>(q[c] < 0 ? -q[c] : q[c]) - 1;
    const auto magnitude =
        static_cast<std::int64_t>(m.magnitude[c][x.around].code(side, asked) & 0xffffff) + 1;
    r[c] = negative ? -magnitude : magnitude;
    before |= std::size_t{1} << std::min<std::size_t>(c, 1);
  }
  return r;
}

}  // namespace mapcodec
