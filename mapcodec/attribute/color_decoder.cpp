// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/color_decoder.hpp"

#include <memory>
#include <tuple>

#include "mapcodec/attribute/color_symbols.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {
namespace {

class ReadPolicy {
 public:
  static constexpr bool kKnows = false;
  explicit ReadPolicy(ByteSpan bytes) : side_(bytes), models_(std::make_unique<ColorModels>()) {}
  std::array<std::int64_t, 3> code(const SplitContext& context, const ColorPoint&, const ColorPoint&) {
    return code_split(side_, *models_, context, {});
  }
  [[nodiscard]] bool ok() const { return side_.ok(); }

 private:
  SymbolReader side_;
  std::unique_ptr<ColorModels> models_;
};

struct Head {
  ColorSettings settings;
  ColorPoint root{};
};

Result<Head> read_head(ByteReader& in, const ChannelInfo& info) {
  Head h;
  const std::uint8_t flags = in.u8();
  const std::uint64_t step = in.varint();
  const std::uint8_t levels = in.u8();
  for (std::int64_t& c : h.root) c = in.signed_varint();
  MAPCODEC_TRY(in.status("colour"));
  h.settings.split_cells = (flags & 1) != 0;
  h.settings.scale = (flags & 2) != 0 ? ColorScale::sixteen : ColorScale::eight;
  h.settings.coarse = (flags & 4) != 0;
  const bool bad_scale = (flags & 2) != 0 && info.scalar == ScalarType::u8;
  const bool bad_coarse = h.settings.coarse && h.settings.split_cells;
  if (flags > 7 || bad_scale || bad_coarse || step == 0 || step >= (1u << 24)) {
    return make_error(ErrorCode::kMalformed, "broken colour head", in.offset());
  }
  h.settings.step = static_cast<std::uint32_t>(step);
  h.settings.levels = levels;
  for (std::int64_t& c : h.root) {
    if (c > (1 << 14) || c < -(1 << 14))
      return make_error(ErrorCode::kMalformed, "impossible colour", in.offset());
    c *= 1 << (kColorFraction - 4);
  }
  return h;
}

}  // namespace

Result<Channel> decode_color(ByteSpan bytes, const ChannelInfo& info, std::span<const VoxelCoord> voxels,
                             const DecodeLimits& limits) {
  // Keys, cells and means by the point, then the levels.
  const std::uint64_t needed =
      128 * std::uint64_t{voxels.size()} + sizeof(ColorNode) * ColorTree::count_nodes(voxels);
  if (voxels.size() > limits.max_points || needed > limits.max_bytes) {
    return make_error(ErrorCode::kLimitExceeded, "colour would need too much memory");
  }
  Channel channel{info, Bytes(voxels.size() * info.stride())};
  if (voxels.empty()) return channel;
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const Head head, read_head(in, info));
  const std::size_t at = in.offset();
  ReadPolicy policy(in.raw(in.left()));
  const ColorTree tree(voxels);
  ColorWalk<ReadPolicy> walk(tree, head.settings, policy);
  const std::vector<ColorPoint> means = walk.run(head.root);
  if (!policy.ok()) return make_error(ErrorCode::kTruncated, "colours end too early", at);
  const ColorLevel& finest = tree.levels().back();
  const auto store = [&](std::uint32_t i, const ColorPoint& p) {
    store_rgb(channel, i, p, head.settings.scale);
  };
  for (std::uint32_t n = 0; n < finest.size(); ++n) {
    const std::uint32_t begin = finest.nodes[n].begin, end = finest.nodes[n + 1].begin;
    if (head.settings.split_cells) {
      walk.split_cell(begin, end, means[n], store);
    } else {
      for (std::uint32_t i = begin; i < end; ++i) store(i, means[n]);
    }
  }
  if (!policy.ok()) return make_error(ErrorCode::kTruncated, "colours end too early", at);
  return channel;
}

}  // namespace mapcodec
