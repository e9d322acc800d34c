// SPDX-License-Identifier: GPL-3.0-or-later
// What a general compressor makes of points: sorted and delta coded, and just as they lie.
#include <zstd.h>

#include <algorithm>
#include <cstring>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/geometry/morton.hpp"
#include "tools/peers/grid.hpp"
#include "tools/peers/peer_list.hpp"

namespace mapcodec::peers {
namespace {

constexpr int kLevel = 19;

Result<Bytes> compress(ByteSpan plain) {
  Bytes out(ZSTD_compressBound(plain.size()));
  const std::size_t n = ZSTD_compress(out.data(), out.size(), plain.data(), plain.size(), kLevel);
  if (ZSTD_isError(n) != 0) return make_error(ErrorCode::kUnsupported, ZSTD_getErrorName(n));
  out.resize(n);
  return out;
}

Result<Bytes> expand(ByteSpan packed, std::size_t plain_size) {
  Bytes out(plain_size);
  const std::size_t n = ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size());
  if (ZSTD_isError(n) != 0 || n != plain_size) return make_error(ErrorCode::kUnsupported, "zstd: wrong size");
  return out;
}

/// x differences of all points, then y, then z: like bytes side by side.
Bytes to_deltas(std::vector<VoxelCoord> cells) {
  std::sort(cells.begin(), cells.end(),
            [](const VoxelCoord& a, const VoxelCoord& b) { return morton_encode(a) < morton_encode(b); });
  ByteWriter out;
  for (std::size_t d = 0; d < 3; ++d) {
    std::int64_t last = 0;
    for (const VoxelCoord& c : cells) {
      out.signed_varint(std::int64_t{c[d]} - last);
      last = c[d];
    }
  }
  return out.take();
}

std::vector<Vec3> from_deltas(ByteSpan bytes, std::size_t count, const Grid& grid) {
  std::vector<VoxelCoord> cells(count);
  ByteReader in(bytes);
  for (std::size_t d = 0; d < 3; ++d) {
    std::int64_t last = 0;
    for (VoxelCoord& c : cells) c[d] = static_cast<std::uint32_t>(last += in.signed_varint());
  }
  std::vector<Vec3> r(count);
  std::transform(cells.begin(), cells.end(), r.begin(), [&](const VoxelCoord& c) { return grid.centre(c); });
  return r;
}

Result<PeerRun> run_deltas(const std::vector<Vec3>& points, double step_m) {
  MAPCODEC_ASSIGN(const Grid grid, make_grid(points, step_m));
  PeerRun run;
  const StopWatch encoding;
  const Bytes plain = to_deltas(grid.cells);
  MAPCODEC_ASSIGN(const Bytes packed, compress(plain));
  run.encode_seconds = encoding.seconds();
  run.bytes = packed.size();
  const StopWatch decoding;
  MAPCODEC_ASSIGN(const Bytes again, expand(packed, plain.size()));
  run.decoded = from_deltas(again, points.size(), grid);
  run.decode_seconds = decoding.seconds();
  return run;
}

Result<PeerRun> run_floats(const std::vector<Vec3>& points, double) {
  Bytes plain(points.size() * 12);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float xyz[3] = {float(points[i][0]), float(points[i][1]), float(points[i][2])};
    std::memcpy(&plain[12 * i], xyz, 12);
  }
  PeerRun run;
  const StopWatch encoding;
  MAPCODEC_ASSIGN(const Bytes packed, compress(plain));
  run.encode_seconds = encoding.seconds();
  run.bytes = packed.size();
  const StopWatch decoding;
  MAPCODEC_ASSIGN(const Bytes again, expand(packed, plain.size()));
  run.decode_seconds = decoding.seconds();
  run.decoded.resize(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    float xyz[3];
    std::memcpy(xyz, &again[12 * i], 12);
    run.decoded[i] = {xyz[0], xyz[1], xyz[2]};
  }
  return run;
}

}  // namespace

void add_zstd(std::vector<Peer>& to) {
  to.push_back({"morton-delta-zstd19", false, true, run_deltas});
  to.push_back({"float32-zstd19", true, true, run_floats});
}

}  // namespace mapcodec::peers
