// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/encode_pipeline.hpp"

#include <time.h>

#include <algorithm>

#include "parallel/guard.hpp"
#include "parallel/memory_share.hpp"
#include "parallel/ordered_pipeline.hpp"

namespace mapcodec {
namespace {

using parallel_detail::guarded;

constexpr std::size_t kTilesPerThread = 4;
/// What an encoder takes for its own arrays, per byte of its tile; the tile itself included.
constexpr std::uint64_t kBytesPerTileByte = 6;

std::size_t default_in_flight(const PipelineSettings& settings) {
  if (settings.max_tiles_in_flight > 0) return settings.max_tiles_in_flight;
  return settings.arena == nullptr ? 1
                                   : kTilesPerThread * static_cast<std::size_t>(settings.arena->threads());
}

std::size_t tiles_in_flight(const TileSet& tiles, const PipelineSettings& settings) {
  std::uint64_t largest = 1;
  for (const TileSet::Entry& t : tiles.tiles()) largest = std::max(largest, t.points);
  const std::uint64_t bytes = largest * bytes_per_point(tiles.layout()) * kBytesPerTileByte;
  const std::uint64_t fit = tiles_in_flight_bytes(settings.memory_budget_bytes) / bytes;
  return std::max<std::size_t>(1, std::min<std::uint64_t>(default_in_flight(settings), fit));
}

/// `f()`, with `name` in front of its error.
template <class F>
auto named(const std::string& name, F&& f) -> decltype(f()) {
  auto r = guarded("coding", std::forward<F>(f));
  if (r.ok()) return r;
  Error e = r.error();
  e.message = name + ": " + e.message;
  return e;
}

void measure(const PipelineSettings& settings, std::size_t i, double since) {
  if (settings.tile_seconds != nullptr) (*settings.tile_seconds)[i] = thread_seconds() - since;
}

void make_room(const PipelineSettings& settings, std::size_t count) {
  if (settings.tile_seconds != nullptr) settings.tile_seconds->assign(count, 0.0);
}

class EncodeRun {
 public:
  EncodeRun(const TileSet& tiles, const TileEncoder& encode, const PipelineSettings& settings,
            const EncodedSink& sink)
      : tiles_(tiles),
        encode_(encode),
        settings_(settings),
        sink_(sink),
        slots_(tiles_in_flight(tiles, settings)) {
    make_room(settings, tiles.tiles().size());
  }

  Status run() {
    const OrderedStages stages{[this](std::size_t s) -> Result<bool> {
                                 slots_[s].tile = next_;
                                 return next_++ < tiles_.tiles().size();
                               },
                               [this](std::size_t s) { return encode(slots_[s]); },
                               [this](std::size_t s) { return deliver(slots_[s]); }};
    return run_ordered(settings_.arena, slots_.size(), stages, settings_.stop, "encoding");
  }

 private:
  struct Slot {
    std::size_t tile = 0;
    EncodedTile encoded;
  };

  Status encode(Slot& slot) const {
    const double since = thread_seconds();
    auto r = named(tile_name(tiles_.tiles()[slot.tile].key), [&]() -> Result<EncodedTile> {
      MAPCODEC_ASSIGN(const PointCloud points, tiles_.load(slot.tile));
      return encode_(points);
    });
    measure(settings_, slot.tile, since);
    if (!r.ok()) return r.error();
    slot.encoded = std::move(r).value();
    return {};
  }

  Status deliver(Slot& slot) {
    const TileSet::Entry& entry = tiles_.tiles()[slot.tile];
    points_ += entry.points;
    bytes_ += slot.encoded.bytes.size();
    MAPCODEC_TRY(sink_(entry.key, std::move(slot.encoded)));
    slot.encoded = {};
    if (settings_.progress) settings_.progress({"encode", points_, tiles_.points(), bytes_});
    return {};
  }

  const TileSet& tiles_;
  const TileEncoder& encode_;
  const PipelineSettings& settings_;
  const EncodedSink& sink_;
  std::vector<Slot> slots_;
  std::size_t next_ = 0;
  std::uint64_t points_ = 0;
  std::uint64_t bytes_ = 0;
};

class DecodeRun {
 public:
  DecodeRun(std::size_t count, const std::function<Result<Bytes>(std::size_t)>& fetch,
            const TileDecoder& decode, const PipelineSettings& settings, const DecodedSink& sink)
      : count_(count), fetch_(fetch), decode_(decode), settings_(settings), sink_(sink) {
    slots_.resize(std::min(default_in_flight(settings), std::max<std::size_t>(1, count)));
    make_room(settings, count);
  }

  Status run() {
    const OrderedStages stages{[this](std::size_t s) { return take(slots_[s]); },
                               [this](std::size_t s) { return decode(slots_[s]); },
                               [this](std::size_t s) { return deliver(slots_[s]); }};
    return run_ordered(settings_.arena, slots_.size(), stages, settings_.stop, "decoding");
  }

 private:
  struct Slot {
    std::size_t tile = 0;
    Bytes bytes;
    PointCloud points;
  };

  Result<bool> take(Slot& slot) {
    if (next_ == count_) return false;
    slot.tile = next_++;
    MAPCODEC_ASSIGN(slot.bytes, fetch_(slot.tile));
    return true;
  }

  Status decode(Slot& slot) const {
    const double since = thread_seconds();
    auto r = named("tile number " + std::to_string(slot.tile), [&] { return decode_(slot.bytes); });
    measure(settings_, slot.tile, since);
    if (!r.ok()) return r.error();
    slot.points = std::move(r).value();
    return {};
  }

  Status deliver(Slot& slot) {
    bytes_ += slot.points.size() * bytes_per_point(slot.points);
    MAPCODEC_TRY(sink_(slot.tile, std::move(slot.points)));
    slot.points = {};
    slot.bytes = {};
    if (settings_.progress) settings_.progress({"decode", slot.tile + 1, count_, bytes_});
    return {};
  }

  std::size_t count_;
  const std::function<Result<Bytes>(std::size_t)>& fetch_;
  const TileDecoder& decode_;
  const PipelineSettings& settings_;
  const DecodedSink& sink_;
  std::vector<Slot> slots_;
  std::size_t next_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace

/// Processor time of this thread: says what a tile costs also on a busy machine.
double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

std::string tile_name(const TileKey& key) {
  if (key.is_unplaced()) return "tile without position";
  return "tile (" + std::to_string(key.x) + ", " + std::to_string(key.y) + ", " + std::to_string(key.z) +
         ") level " + std::to_string(key.level);
}

Status encode_tiles(const TileSet& tiles, const TileEncoder& encode, const PipelineSettings& settings,
                    const EncodedSink& sink) {
  return guarded("encoding", [&] { return EncodeRun(tiles, encode, settings, sink).run(); });
}

Status encode_tiles(const TileSet& tiles, const MapSchema& schema, const TileSettings& tile_settings,
                    const PipelineSettings& settings, const EncodedSink& sink) {
  return encode_tiles(
      tiles, [&](const PointCloud& tile) { return encode_tile(tile, schema, tile_settings); }, settings,
      sink);
}

Status decode_tiles(std::size_t count, const std::function<Result<Bytes>(std::size_t)>& fetch,
                    const TileDecoder& decode, const PipelineSettings& settings, const DecodedSink& sink) {
  return guarded("decoding", [&] { return DecodeRun(count, fetch, decode, settings, sink).run(); });
}

Status decode_tiles(std::size_t count, const std::function<Result<Bytes>(std::size_t)>& fetch,
                    const MapSchema& schema, const DecodeLimits& limits, const PipelineSettings& settings,
                    const DecodedSink& sink) {
  return decode_tiles(
      count, fetch, [&](ByteSpan bytes) { return decode_tile(bytes, schema, limits); }, settings, sink);
}

}  // namespace mapcodec
