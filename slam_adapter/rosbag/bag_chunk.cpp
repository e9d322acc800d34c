// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/bag_chunk.hpp"

#include <bzlib.h>
#include <lz4frame.h>

#include <algorithm>
#include <memory>

namespace mapcodec {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr std::size_t kFirstBytes = std::size_t{1} << 20;

Error broken(const char* what) {
  return make_error(ErrorCode::kMalformed, std::string("holds a chunk that does not unpack (") + what + ")");
}

/// Room for more of `size` bytes after `used`: doubles, so that a lying size costs nothing.
void grow(Bytes& out, std::size_t used, std::size_t size) {
  out.resize(std::min(size, std::max(kFirstBytes, 2 * used)));
}

Result<Bytes> unpack_lz4(const Bytes& packed, std::size_t size) {
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION))) return broken("lz4");
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> context(raw,
                                                                             LZ4F_freeDecompressionContext);
  Bytes out;
  std::size_t in = 0, used = 0;
  for (;;) {
    if (used == out.size()) grow(out, used, size);
    std::size_t written = out.size() - used, read = packed.size() - in;
    const std::size_t hint =
        LZ4F_decompress(raw, out.data() + used, &written, packed.data() + in, &read, nullptr);
    if (LZ4F_isError(hint)) return broken("lz4");
    in += read;
    used += written;
    if (hint == 0 && used == size) return out;
    if (hint == 0 || (read == 0 && written == 0)) return broken("lz4, of another length");
  }
}

Result<Bytes> unpack_bz2(Bytes& packed, std::size_t size) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return broken("bz2");
  const std::unique_ptr<bz_stream, int (*)(bz_stream*)> guard(&stream, BZ2_bzDecompressEnd);
  stream.next_in = reinterpret_cast<char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  Bytes out;
  std::size_t used = 0;
  for (;;) {
    if (used == out.size()) grow(out, used, size);
    stream.next_out = reinterpret_cast<char*>(out.data() + used);
    stream.avail_out = static_cast<unsigned>(out.size() - used);
    const unsigned in_before = stream.avail_in, out_before = stream.avail_out;
    const int state = BZ2_bzDecompress(&stream);
    used += out_before - stream.avail_out;
    if (state == BZ_STREAM_END && used == size) return out;
    if (state != BZ_OK) return broken("bz2");
    if (in_before == stream.avail_in && out_before == stream.avail_out)
      return broken("bz2, of another length");
  }
}

}  // namespace

Result<Bytes> unpack_bag_chunk(const std::string& compression, Bytes packed, std::uint32_t size) {
  if (size > kMostBytes)
    return make_error(ErrorCode::kLimitExceeded,
                      "holds a chunk of " + std::to_string(size) + " bytes; at most 1 GiB is unpacked");
  if (compression == "none") {
    if (packed.size() != size) return broken("none, of another length");
    return packed;
  }
  if (compression == "lz4") return unpack_lz4(packed, size);
  if (compression == "bz2") return unpack_bz2(packed, size);
  return make_error(ErrorCode::kUnsupported,
                    "holds a chunk compressed by '" + compression + "'; none, bz2 and lz4 are read");
}

}  // namespace mapcodec
