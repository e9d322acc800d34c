// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>

#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

/// Reverses the bytes of each of `count` scalars of `size` bytes.
inline void swap_scalars(std::uint8_t* bytes, std::size_t size, std::size_t count) {
  for (std::size_t i = 0; i < count && size > 1; ++i) std::reverse(bytes + i * size, bytes + (i + 1) * size);
}

/// Reverses the bytes of each scalar of `fields` in `count` records: from big-endian to little-endian and
/// back.
inline void swap_fields(const std::vector<RecordField>& fields, std::size_t stride, std::uint8_t* rows,
                        std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    for (const RecordField& f : fields)
      swap_scalars(rows + i * stride + f.offset, scalar_size(f.scalar), f.components);
  }
}

}  // namespace mapcodec
