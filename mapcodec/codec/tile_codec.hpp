// SPDX-License-Identifier: GPL-3.0-or-later
// The shape of every tile codec: a tile becomes bytes by a pure function, and back.
#pragma once

#include <memory>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/decode_limits.hpp"
#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/map_schema.hpp"
#include "mapcodec/cloud/point_cloud.hpp"
#include "mapcodec/cloud/tile_borders.hpp"
#include "mapcodec/cloud/tile_key.hpp"

namespace mapcodec {

/// First byte of every tile payload (FORMAT.md 3). Ids are never reused.
/// `erasure` and `joined` are no codecs: see tile_segments.hpp.
enum class CodecId : std::uint8_t {
  lossless = 1,
  points = 2,
  paper = 3,
  surface = 4,
  occupancy = 5,
  erasure = 6,
  joined = 7
};
[[nodiscard]] constexpr const char* codec_name(CodecId id) {
  constexpr const char* kNames[] = {"?",       "lossless",  "points",  "paper",
                                    "surface", "occupancy", "erasure", "updated"};
  return kNames[static_cast<std::size_t>(id) <= 7 ? static_cast<std::size_t>(id) : 0];
}

/// Speed against size at the same promise.
enum class Effort : std::uint8_t { fast, standard, high };

/// Parameters of the 2014 paper's method (PAPER.md, Algorithm 1), in metres where they are lengths.
struct PaperSettings {
  double perc_process = 0.05;      ///< stop when this share of the points is left
  double distance_m = 0.05;        ///< RANSAC inlier threshold
  std::uint32_t min_points = 200;  ///< smallest plane [points]
  std::uint32_t outlier_k =
      5;  ///< a point with fewer neighbours than this within outlier_radius_m is isolated
  double outlier_radius_m = 0.2;
  std::uint32_t clusters = 1;  ///< K of K-means on colour
  double alpha_m = 0.15;       ///< radius of the alpha shape; smaller: more detail
  double rel_area = 1;         ///< least points per square metre of a kept triangle
  double outside_density = 0;  ///< a triangle outside the outline needs this share of the density at its
                               ///< cluster's median point, too (the paper: 0)
  double reduction_m = 0.02;   ///< contour reduction: largest distance of a left-out vertex to the outline
  double leftover_step_m = 0.002;  ///< voxel side of the remaining points (entropy-coded form)
  bool raw = false;                ///< store as the paper did (floats), to compare its own ratio
};

class TileMemo;

/// What a surface encoder weighs against each other. No decoder needs to know it.
struct SurfaceTrade {
  /// Squared error [steps^2], summed over points, that one bit has to save. With less the step is larger at
  /// the same error: more cells, and planes that are told less exactly.
  double bit_price = 1;
  /// Of the squared distances from original to decoded points; the rest is of those back.
  double forward_weight = 0.3;
  bool operator==(const SurfaceTrade&) const = default;
};

struct TileSettings {
  CodecId codec = CodecId::points;
  Effort effort = Effort::standard;
  bool keep_counts = true;  ///< points: voxels keep how many points they stood for
  double step_m = 0;        ///< points, surface: this tile's own step (written into it); 0: schema.step_m
  /// surface: > 0: bounded colour is not coded to its bound but so that the last bit saves this much error
  /// (see SurfaceColorEncoder). The map's bound is then the caller's to keep.
  double color_slope = 0;
  /// points, surface: for searches. Where no channel is coded, the RMS is measured on a part of the points
  /// (within about 1 %), and neither the largest nor the density error is.
  bool rough_errors = false;
  SurfaceTrade trade;
  TileBorders borders;  ///< surface: where nothing is known of other tiles, its surface ends with its points
  PaperSettings paper;
};

/// What a tile lost, measured by its encoder on what its decoder will give.
struct TileErrors {
  double rms_m = 0;             ///< symmetric: the larger direction
  double max_axis_error_m = 0;  ///< largest error along one axis (surface: a bound for it)
  double color_error = 0;       ///< mean RGB distance, 0..255 scale
  double density_error = 0;     ///< sum |n_dec - n_orig| / N over 10 cm voxels
};

struct EncodedTile {
  CodecId codec = CodecId::points;
  Bytes bytes;                       ///< payload, FORMAT.md 3
  std::uint64_t points = 0;          ///< points the decoder will give
  std::uint64_t input_points = 0;    ///< points that went in
  std::uint64_t geometry_bytes = 0;  ///< of `bytes`, what is not channels
  Box bounds;                        ///< of the decoded points and the original ones
  TileErrors errors;
  double rms_forward_m = 0;      ///< root mean square distance of the original points to the decoded ones
  double rms_backward_m = 0;     ///< of the decoded points to the original ones
  double least_color_error = 0;  ///< surface: what colours on these positions lose at least, about
};

/// Encodes the points of one tile. Pure: same input, same bytes, on any thread.
/// @param tile      points [m, map frame], channels as in schema.channels (all, dropped ones too, same
/// order).
/// @param schema    schema.step_m and schema.channels say what is kept.
/// @param memo      surface: if it remembers this tile at this step, its positions are not coded again;
///                  otherwise it remembers them from now on, unless errors are rough. Same bytes without it.
/// Errors: InvalidArgument (non-finite points in a lossy codec, a lattice finer than 2^21 cells a side, empty
/// tile).
[[nodiscard]] Result<EncodedTile> encode_tile(const PointCloud& tile, const MapSchema& schema,
                                              const TileSettings& settings, TileMemo* memo = nullptr);

/// Decodes one tile payload, which may be hostile.
/// @return points laid out as schema.layout().
/// Errors: Truncated, Malformed, LimitExceeded, UnknownCodec (with byte offset). Threads: pure.
[[nodiscard]] Result<PointCloud> decode_tile(ByteSpan bytes, const MapSchema& schema,
                                             const DecodeLimits& limits = {});

/// What the first bytes of a payload say, without decoding it.
struct TileHeader {
  CodecId codec = CodecId::points;
  std::uint64_t points = 0;
};
[[nodiscard]] Result<TileHeader> read_tile_header(ByteSpan bytes);

}  // namespace mapcodec
