// SPDX-License-Identifier: GPL-3.0-or-later
// What the XML of an E57 file says about its scans.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "mapcodec/cloud/vec3.hpp"
#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

/// One number of each point, and how its bit stream stores it.
struct E57Field {
  enum class Kind : std::uint8_t { f32, f64, integer, scaled, text };
  std::string name;  ///< "cartesianX"
  Kind kind = Kind::f64;
  std::int64_t min = 0, max = 0;  ///< integers: stored as the bits of value - min
  double scale = 1, offset = 0;   ///< scaled: integer * scale + offset

  [[nodiscard]] unsigned bits() const;
};

struct E57Scan {
  std::string name;
  std::uint64_t records = 0;
  std::uint64_t section = 0;  ///< logical offset of its points
  std::vector<E57Field> fields;
  Vec3 translation_m{0, 0, 0};
  std::array<double, 4> rotation_wxyz{1, 0, 0, 0};  ///< of length 1
  bool moved = false;                               ///< whether the pose is not the identity

  [[nodiscard]] const E57Field* find(const std::string& field) const;
};

struct E57Description {
  std::vector<E57Scan> scans;  ///< those with points
  std::size_t images = 0;      ///< left out
};

/// @param pages  the file without checksums. @param file_bytes  as the file's header says, for its check.
/// Errors: Truncated, Malformed, Unsupported, Empty.
[[nodiscard]] Result<E57Description> read_e57_description(const ByteStream& file, const ByteStream& pages);

}  // namespace mapcodec
