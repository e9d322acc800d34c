// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <span>

#include "mapcodec/attribute/value_lattice.hpp"

namespace mapcodec {

/// The coarsest decimal, binary or product lattice that holds nearly all of `values`.
/// @param single  the values are float32 numbers.
/// @param share   of the values that need not be on it (NaN, -0 and infinities never are).
/// @return nullopt if there is none. Threads: pure.
[[nodiscard]] std::optional<ValueLattice> find_lattice(std::span<const double> values, bool single,
                                                       double share);

}  // namespace mapcodec
