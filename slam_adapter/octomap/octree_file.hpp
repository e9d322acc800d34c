// SPDX-License-Identifier: GPL-3.0-or-later
// OctoMap's files, read and written without OctoMap: its own readers trust every byte.
#pragma once

#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/occupancy_tree.hpp"

namespace mapcodec {

/// What a .bt or .ot file holds.
struct OctreeFile {
  OccupancyTree tree;  ///< of height 16
  double resolution_m = 0.1;
  std::uint64_t bytes = 0;  ///< of the file
};

/// Reads a file of bytes, which may be hostile: .bt (and its form before OctoMap 1.0), .ot of OcTree and
/// ColorOcTree. An inner node of a .bt without children is a free leaf, as OctoMap takes it. Errors: Empty
/// (no node), Truncated, Malformed (header, depth, number of nodes), Unsupported (another kind of tree),
/// LimitExceeded.
[[nodiscard]] Result<OctreeFile> parse_octree(ByteSpan bytes, const DecodeLimits& limits = {});
/// Errors: also NotFound, Unreadable.
[[nodiscard]] Result<OctreeFile> read_octree(const std::string& path, const DecodeLimits& limits = {});

/// Whether a file is one of these: by its first bytes, or by the name where they say nothing.
[[nodiscard]] bool is_octree_file(const std::string& path);
/// Whether a name ends in .bt or .ot.
[[nodiscard]] bool is_octree_name(const std::string& path);

enum class OctreeFormat { bt, ot };
/// As OctoMap writes it, byte for byte. A tree with log-odds becomes a .bt by its cells; a binary one becomes
/// an .ot with OctoMap's default clamping thresholds.
/// @param tree  of height 16, not empty.
[[nodiscard]] Bytes format_octree(const OccupancyTree& tree, double resolution_m, OctreeFormat format);
/// The format as the name ends. The file appears when it is complete. Errors: CannotWrite, InvalidArgument
/// (name).
[[nodiscard]] Status write_octree(const std::string& path, const OccupancyTree& tree, double resolution_m);

/// The same tree with the log-odds that OctoMap gives to cells of a .bt; others stay as they are.
[[nodiscard]] OccupancyTree with_log_odds(OccupancyTree tree);

}  // namespace mapcodec
