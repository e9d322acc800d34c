// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/value_decoder.hpp"

#include "mapcodec/attribute/scalar_bits.hpp"
#include "mapcodec/attribute/symbol_side.hpp"
#include "mapcodec/attribute/value_coder.hpp"

namespace mapcodec {
namespace {

Result<std::vector<ComponentPlan>> read_plans(ByteReader& in, const ChannelInfo& info) {
  std::vector<ComponentPlan> plans;
  for (std::size_t c = 0; c < info.components; ++c) {
    MAPCODEC_ASSIGN(ComponentPlan p, read_plan(in, info.scalar));
    plans.push_back(std::move(p));
  }
  return plans;
}

std::uint64_t most_ordered(ScalarType scalar) {
  return ~std::uint64_t{0} >> (64 - 8 * scalar_size(scalar));
}

}  // namespace

std::uint64_t plan_value(const ComponentPlan& plan, ScalarType scalar, std::uint64_t u) {
  if (!plan.palette.empty()) u = plan.palette[u];
  const std::uint64_t key = plan.base + u * plan.divisor;
  if (!plan.on_lattice) return std::min(key, most_ordered(scalar));
  const double v = plan.lattice.value(static_cast<std::int64_t>(key - kLatticeKeyBias));
  return scalar == ScalarType::f32 ? ordered_bits(static_cast<float>(v)) : ordered_bits(v);
}

Result<Channel> decode_values(ByteSpan bytes, const ChannelInfo& info, std::span<const VoxelCoord> voxels,
                              const DecodeLimits& limits) {
  ByteReader in(bytes);
  MAPCODEC_ASSIGN(const std::vector<ComponentPlan> plans, read_plans(in, info));
  const std::size_t count = voxels.size() * plans.size();
  // Integers, residuals, escapes and the values themselves.
  if (voxels.size() > limits.max_points || count > limits.max_bytes / 40) {
    return make_error(ErrorCode::kLimitExceeded, "channel '" + info.name + "' would need too much memory");
  }
  const bool escapes =
      std::any_of(plans.begin(), plans.end(), [](const ComponentPlan& p) { return p.escapes; });
  std::vector<std::uint64_t> values(count), escaped(escapes ? count : 0);
  std::vector<std::uint8_t> mask(escapes ? count : 0);
  const std::size_t head = in.offset();
  SymbolReader side(in.raw(in.left()));
  if (!ValueCoder<SymbolReader>(side, plans, voxels, values, escaped, mask).run()) {
    return make_error(ErrorCode::kMalformed, "values of channel '" + info.name + "' are damaged", head);
  }
  Channel channel{info, Bytes(voxels.size() * info.stride())};
  for (std::size_t i = 0, at = 0; i < voxels.size(); ++i) {
    for (std::size_t c = 0; c < plans.size(); ++c, ++at) {
      const bool in_full = escapes && mask[at] != 0;
      const std::uint64_t v = in_full ? escaped[at] : plan_value(plans[c], info.scalar, values[at]);
      store_ordered(channel, i, component_at(info, c), v);
    }
  }
  return channel;
}

}  // namespace mapcodec
