// SPDX-License-Identifier: GPL-3.0-or-later
// One column of the index: many small integers that resemble each other (FORMAT.md, Columns).
#pragma once

#include <span>
#include <vector>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"

namespace mapcodec {

/// Appends `values` in the smallest of the column's forms. Deterministic for one version of zstd.
void write_column(ByteWriter& out, std::span<const std::uint64_t> values);

/// Reads `count` values, which the caller has bounded by the bytes at hand.
/// Errors: Truncated, Malformed (unknown form, a sum beyond 64 bits, a broken zstd frame).
[[nodiscard]] Result<std::vector<std::uint64_t>> read_column(ByteReader& in, std::size_t count);

}  // namespace mapcodec
