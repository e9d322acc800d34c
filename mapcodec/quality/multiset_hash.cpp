// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/multiset_hash.hpp"

#include <algorithm>
#include <bit>
#include <string_view>

namespace mapcodec {
namespace {

constexpr std::uint64_t scramble(std::uint64_t h) {
  h = (h ^ (h >> 31)) * 0xBF58476D1CE4E5B9u;
  h = (h ^ (h >> 29)) * 0x94D049BB133111EBu;
  return h ^ (h >> 32);
}

/// Two lanes that see the same words and are stirred with different constants.
class Lanes {
 public:
  void word(std::uint64_t w) {
    a_ = std::rotl((a_ ^ w) * 0x9FB21C651E98DF25u, 29) + b_;
    b_ = (std::rotl(b_, 23) + w) * 0xC4CEB9FE1A85EC53u ^ (a_ >> 35);
  }
  void bytes(const std::uint8_t* data, std::size_t count) {
    for (; count >= 8; count -= 8, data += 8) word(little_endian(data, 8));
    // The length of the rest goes along, so that trailing zeros count.
    if (count > 0) word(little_endian(data, count) | (std::uint64_t{count} << 56));
  }
  [[nodiscard]] std::uint64_t low() const { return scramble(a_ + std::rotl(b_, 17)); }
  [[nodiscard]] std::uint64_t high() const {
    return scramble((b_ ^ std::rotl(a_, 41)) + 0xD1B54A32D192ED03u);
  }

 private:
  static std::uint64_t little_endian(const std::uint8_t* data, std::size_t count) {
    std::uint64_t v = 0;
    for (std::size_t i = 0; i < count; ++i) v |= std::uint64_t{data[i]} << (8 * i);
    return v;
  }
  std::uint64_t a_ = 0x243F6A8885A308D3u, b_ = 0x13198A2E03707344u;
};

/// The stored integer where there is one, else the bits of the double.
std::uint64_t fixed_bits(double x, double scale, double offset) {
  const double v = std::round((x - offset) / scale);
  if (!(std::abs(v) <= 2147483648.0)) return ~std::bit_cast<std::uint64_t>(x);
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(v));
}

std::uint64_t coordinate_bits(const CoordinateFormat& format, double x, std::size_t axis) {
  switch (format.kind) {
    case CoordinateFormat::Kind::f32:
      return std::bit_cast<std::uint32_t>(static_cast<float>(x));
    case CoordinateFormat::Kind::fixed:
      return fixed_bits(x, format.scale[axis], format.offset[axis]);
    case CoordinateFormat::Kind::f64:
      break;
  }
  return std::bit_cast<std::uint64_t>(x);
}

std::vector<const Channel*> by_name(const PointCloud& cloud) {
  std::vector<const Channel*> r;
  for (const Channel& c : cloud.channels) r.push_back(&c);
  std::sort(r.begin(), r.end(),
            [](const Channel* a, const Channel* b) { return a->info.name < b->info.name; });
  return r;
}

/// What all points of a layout have in common: names and types.
Lanes begin_lanes(const PointCloud& cloud, const std::vector<const Channel*>& channels) {
  Lanes lanes;
  lanes.word(static_cast<std::uint64_t>(cloud.coordinates.kind));
  for (const Channel* c : channels) {
    lanes.word(static_cast<std::uint64_t>(c->info.scalar) << 8 | c->info.components);
    const std::string_view name = c->info.name;
    for (const char letter : name) lanes.word(static_cast<std::uint8_t>(letter));
  }
  return lanes;
}

}  // namespace

void MultisetHash::add_sum(std::uint64_t low, std::uint64_t high) {
  low_ += low;
  high_ += high + (low_ < low ? 1 : 0);
}

void MultisetHash::add(const PointCloud& block) {
  const std::vector<const Channel*> channels = by_name(block);
  const Lanes start = begin_lanes(block, channels);
  for (std::size_t i = 0; i < block.size(); ++i) {
    Lanes lanes = start;
    for (std::size_t d = 0; d < 3; ++d) lanes.word(coordinate_bits(block.coordinates, block.xyz[i][d], d));
    for (const Channel* c : channels) lanes.bytes(c->at(i), c->info.stride());
    add_sum(lanes.low(), lanes.high());
  }
  points_ += block.size();
}

void MultisetHash::merge(const MultisetHash& other) {
  add_sum(other.low_, other.high_);
  points_ += other.points_;
}

std::string MultisetHash::hex() const {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string r;
  for (const std::uint64_t half : {high_, low_}) {
    for (int shift = 60; shift >= 0; shift -= 4) r.push_back(kDigits[(half >> shift) & 15]);
  }
  return r;
}

MultisetHash multiset_hash(const PointCloud& cloud) {
  MultisetHash h;
  h.add(cloud);
  return h;
}

}  // namespace mapcodec
