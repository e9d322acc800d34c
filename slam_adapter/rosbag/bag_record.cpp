// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rosbag/bag_record.hpp"

#include <algorithm>

namespace mapcodec {

std::optional<BagFields> BagFields::parse(ByteSpan bytes) {
  BagFields r;
  ByteReader in(bytes);
  while (in.left() > 0) {
    const ByteSpan field = in.raw(in.u32());
    const auto equals = std::find(field.begin(), field.end(), std::uint8_t{'='});
    if (!in.ok() || equals == field.end()) return std::nullopt;
    const auto length = static_cast<std::size_t>(equals - field.begin());
    r.values_[std::string(field.begin(), equals)] = field.subspan(length + 1);
  }
  if (!in.ok()) return std::nullopt;
  return r;
}

std::string BagFields::text(const std::string& name) const {
  const auto it = values_.find(name);
  return it == values_.end() ? std::string() : std::string(it->second.begin(), it->second.end());
}

std::optional<std::uint32_t> BagFields::u32(const std::string& name) const {
  const auto it = values_.find(name);
  if (it == values_.end() || it->second.size() != 4) return std::nullopt;
  return ByteReader(it->second).u32();
}

std::optional<std::uint64_t> BagFields::u64(const std::string& name) const {
  const auto it = values_.find(name);
  if (it == values_.end() || it->second.size() != 8) return std::nullopt;
  return ByteReader(it->second).u64();
}

std::optional<std::int64_t> BagFields::time_ns(const std::string& name) const {
  const auto packed = u64(name);
  if (!packed) return std::nullopt;
  return static_cast<std::int64_t>(*packed & 0xffffffffu) * 1'000'000'000 +
         static_cast<std::int64_t>(*packed >> 32);
}

std::optional<BagOp> BagFields::op() const {
  const auto it = values_.find("op");
  if (it == values_.end() || it->second.size() != 1) return std::nullopt;
  return static_cast<BagOp>(it->second[0]);
}

}  // namespace mapcodec
