// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/color_decoder.hpp"

#include <memory>
#include <tuple>

#include "mapcodec/attribute/color_symbols.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/base/byte_reader.hpp"

namespace mapcodec {
namespace {

template <class Models>
class ReadPolicy {
 public:
  static constexpr bool kKnows = false;
  explicit ReadPolicy(ByteSpan bytes) : side_(bytes), models_(std::make_unique<Models>()) {}
  ColorSymbols code(const SplitContext& context, const ColorPoint&, const ColorPoint&) {
    return code_split(side_, *models_, context, {});
  }
  [[nodiscard]] bool ok() const { return side_.ok(); }

 private:
  SymbolReader side_;
  std::unique_ptr<Models> models_;
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
  h.settings.coarse = (flags & 8) != 0;
  if (h.settings.coarse) h.settings.trust = in.u8();
  MAPCODEC_TRY(in.status("colour"));
  h.settings.split_cells = (flags & 1) != 0;
  h.settings.scale = (flags & 2) != 0 ? ColorScale::sixteen : ColorScale::eight;
  const bool bad_scale = (flags & 2) != 0 && info.scalar == ScalarType::u8;
  const bool bad_coarse = h.settings.coarse && h.settings.split_cells;
  if ((flags & 4) != 0) {
    return make_error(ErrorCode::kUnsupported, "colours in an earlier coarse form: compress the map again",
                      in.offset());
  }
  if (flags > 11 || bad_scale || bad_coarse || h.settings.trust > kMostTrust || step == 0 ||
      step >= (1u << 24)) {
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

/// False if the symbols end too early.
template <class Models>
bool read_colors(ByteSpan symbols, const ColorTree& tree, const Head& head, Channel& channel) {
  ReadPolicy<Models> policy(symbols);
  ColorWalk<ReadPolicy<Models>> walk(tree, head.settings, policy);
  const std::vector<ColorPoint> means = walk.run(head.root);
  if (!policy.ok()) return false;
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
  return policy.ok();
}

}  // namespace

Result<Channel> decode_color(ByteSpan bytes, const ChannelInfo& info, std::span<const VoxelCoord> voxels,
                             const DecodeLimits& limits) {
  if (voxels.empty()) return Channel{info, {}};
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const Head head, read_head(in, info));
  // Keys, cells and means by the point, then the levels.
  const std::uint64_t node_bytes =
      sizeof(ColorNode) + sizeof(FaceNodes) + (head.settings.coarse ? sizeof(EdgeNodes) : 0);
  const std::uint64_t needed =
      128 * std::uint64_t{voxels.size()} + node_bytes * ColorTree::count_nodes(voxels);
  if (voxels.size() > limits.max_points || needed > limits.max_bytes) {
    return make_error(ErrorCode::kLimitExceeded, "colour would need too much memory");
  }
  const std::size_t at = in.offset();
  const ByteSpan symbols = in.raw(in.left());
  Channel channel{info, Bytes(voxels.size() * info.stride())};
  const ColorTree tree(voxels, head.settings.coarse);
  const bool whole = head.settings.coarse ? read_colors<CoarseColorModels>(symbols, tree, head, channel)
                                          : read_colors<ColorModels>(symbols, tree, head, channel);
  if (!whole) return make_error(ErrorCode::kTruncated, "colours end too early", at);
  return channel;
}

}  // namespace mapcodec
