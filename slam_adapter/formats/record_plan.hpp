// SPDX-License-Identifier: GPL-3.0-or-later
// How the fixed-size records of a file map to coordinates and channels, both ways. Records are little-endian;
// readers of text and of big-endian files bring theirs into that shape first.
#pragma once

#include <array>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// One field of a record as a header declares it. Fields named "_" are padding.
struct RecordField {
  std::string name;
  ScalarType scalar = ScalarType::f32;
  std::size_t components = 1;
  std::size_t offset = 0;
};

class RecordPlan {
 public:
  struct Axis {
    ScalarType scalar = ScalarType::f32;
    std::size_t offset = 0;
  };
  /// Bytes that go from the record to a channel's value; with a mask, one byte: (record >> shift) & mask.
  struct Move {
    std::size_t channel = 0;
    std::size_t from = 0, to = 0;
    std::size_t bytes = 0;
    unsigned shift = 0, mask = 0xff;
  };

  PointCloud layout;  ///< what decoding makes; no point
  std::size_t stride = 0;
  std::array<Axis, 3> axes;
  std::vector<Move> moves;

  /// Names decide: x, y, z; red/green/blue; normal_x/y/z, nx/ny/nz; with `packed_rgb` also four bytes called
  /// rgb or rgba. Errors: Malformed (no x, y or z, a name twice), Unsupported (more than 255 fields or
  /// components).
  [[nodiscard]] static Result<RecordPlan> from_fields(const std::vector<RecordField>& fields,
                                                      std::size_t stride, bool packed_rgb);

  /// Adds a channel taken from `bytes` contiguous bytes at `offset`.
  void add_channel(ChannelInfo info, std::size_t offset);
  /// Adds a u8 channel of some bits of the byte at `offset`.
  void add_bits(const std::string& name, std::size_t offset, unsigned shift, unsigned mask);

  /// Rows a block may have so that both rows and block stay below some MiB; at most 65,536.
  [[nodiscard]] std::size_t rows_per_block() const;
  /// Replaces `block` (laid out as `layout`) by the `count` records at `rows`.
  void decode(const std::uint8_t* rows, std::size_t count, PointCloud& block) const;
  /// The reverse, into records that are zero where nothing is written. `sources[c]` is the channel of `block`
  /// that holds channel c, or -1. Returns false if a fixed coordinate does not fit 32 bits.
  [[nodiscard]] bool encode(const PointCloud& block, const std::vector<int>& sources,
                            std::uint8_t* rows) const;
  /// For each channel of this plan the one of `from` with the same name and type, or -1.
  [[nodiscard]] std::vector<int> match(const PointCloud& from) const;

 private:
  void decode_xyz(const std::uint8_t* rows, std::size_t count, std::vector<Vec3>& xyz) const;
  [[nodiscard]] bool encode_xyz(const std::vector<Vec3>& xyz, std::uint8_t* rows) const;
};

}  // namespace mapcodec
