// SPDX-License-Identifier: GPL-3.0-or-later
// The reader of .bt and .ot files on any bytes; what it reads is written and read again, and is the same.
#include <cstdlib>

#include "slam_adapter/octomap/octree_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  DecodeLimits limits;
  limits.max_bytes = std::uint64_t{1} << 26;
  const auto file = parse_octree(ByteSpan(data, size), limits);
  if (!file) return 0;
  const bool binary = file->tree.kind == OccupancyKind::binary;
  const Bytes bytes =
      format_octree(file->tree, file->resolution_m, binary ? OctreeFormat::bt : OctreeFormat::ot);
  const auto again = parse_octree(bytes);
  if (!again || !(again->tree == file->tree)) std::abort();
  if (again->resolution_m != file->resolution_m) std::abort();
  return 0;
}
