// SPDX-License-Identifier: GPL-3.0-or-later
// Tiles to bytes and back on many threads, in Morton order, in bounded memory.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "mapcodec/codec/tile_codec.hpp"
#include "parallel/arena.hpp"
#include "parallel/progress.hpp"
#include "parallel/tile_set.hpp"

namespace mapcodec {

struct PipelineSettings {
  Arena* arena = nullptr;  ///< nullptr: on the caller's thread
  /// Tiles (or payloads) that are in memory at once; 0: 4 per thread, fewer if the budget holds fewer of the
  /// largest. Four, because results leave in order: with two, a slow tile holds up all threads.
  std::size_t max_tiles_in_flight = 0;
  std::uint64_t memory_budget_bytes = std::uint64_t{2}
                                      << 30;  ///< of the whole program; half of it is for tiles
  ProgressCallback progress;                  ///< after each tile, in order
  const std::atomic<bool>* stop = nullptr;
  std::vector<double>* tile_seconds = nullptr;  ///< out: processor time [s] of each tile, by its number
};

/// One tile to bytes; encode_tile with its settings, or another. Called by several threads at once.
using TileEncoder = std::function<Result<EncodedTile>(const PointCloud&)>;
/// One payload to points. Called by several threads at once.
using TileDecoder = std::function<Result<PointCloud>(ByteSpan)>;

/// Called by one thread at a time, in Morton order.
using EncodedSink = std::function<Status(const TileKey&, EncodedTile&&)>;
/// Called by one thread at a time, in the order of the numbers.
using DecodedSink = std::function<Status(std::size_t, PointCloud&&)>;

/// Encodes all tiles and hands them to `sink`. The calls of `sink` are the same for any number of threads.
/// Errors: of the first tile in Morton order that failed, with its key in the message (later tiles do not
/// reach the sink); those of the sink; Cancelled. What encoders throw is caught.
[[nodiscard]] Status encode_tiles(const TileSet& tiles, const TileEncoder& encode,
                                  const PipelineSettings& settings, const EncodedSink& sink);
[[nodiscard]] Status encode_tiles(const TileSet& tiles, const MapSchema& schema,
                                  const TileSettings& tile_settings, const PipelineSettings& settings,
                                  const EncodedSink& sink);

/// Decodes payloads 0 .. count - 1 and hands the points to `sink`.
/// @param fetch  the bytes of payload i; called by one thread at a time, in order.
/// Errors: of the first payload that failed, with its number in the message; those of fetch and sink;
/// Cancelled.
[[nodiscard]] Status decode_tiles(std::size_t count, const std::function<Result<Bytes>(std::size_t)>& fetch,
                                  const TileDecoder& decode, const PipelineSettings& settings,
                                  const DecodedSink& sink);
[[nodiscard]] Status decode_tiles(std::size_t count, const std::function<Result<Bytes>(std::size_t)>& fetch,
                                  const MapSchema& schema, const DecodeLimits& limits,
                                  const PipelineSettings& settings, const DecodedSink& sink);

/// "tile (x, y, z) level l", "tile without position".
[[nodiscard]] std::string tile_name(const TileKey& key);

/// Processor time of the calling thread [s]: what tile_seconds is measured with.
[[nodiscard]] double thread_seconds();

}  // namespace mapcodec
