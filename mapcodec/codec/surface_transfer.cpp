// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_transfer.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mapcodec/attribute/color_space.hpp"

namespace mapcodec {
namespace {

using Rgb = std::array<std::int64_t, 3>;

void store(Channel& c, std::size_t i, const Rgb& sum, std::int64_t count) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::int64_t mean = (sum[k] + count / 2) / count;
    if (c.info.scalar == ScalarType::u16) {
      c.set<std::uint16_t>(i, static_cast<std::uint16_t>(mean), k);
    } else {
      c.at(i)[k] = static_cast<std::uint8_t>(mean);
    }
  }
}

void add(Rgb& sum, const Rgb& v) {
  for (std::size_t k = 0; k < 3; ++k) sum[k] += v[k];
}

double distance(const Rgb& a, const Rgb& b) {
  std::int64_t s = 0;
  for (std::size_t k = 0; k < 3; ++k) s += (a[k] - b[k]) * (a[k] - b[k]);
  return std::sqrt(static_cast<double>(s));
}

Channel gather(const Channel& from, std::span<const std::uint32_t> order) {
  Channel to{from.info, Bytes(order.size() * from.info.stride())};
  for (std::size_t i = 0; i < order.size(); ++i) std::memcpy(to.at(i), from.at(order[i]), from.info.stride());
  return to;
}

}  // namespace

Channel transfer_color(const Channel& original, const NearestPair& near, const SamePositions& ties) {
  const std::size_t n = near.back.index.size();
  std::vector<Rgb> sums(n, Rgb{});
  std::vector<std::uint32_t> counts(n);
  for (std::size_t i = 0; i < near.forth.index.size(); ++i) {
    add(sums[near.forth.index[i]], load_rgb(original, i));
    ++counts[near.forth.index[i]];
  }
  Channel r{original.info, Bytes(n * original.info.stride())};
  for (std::size_t i = 0; i < n; ++i) {
    if (counts[i] == 0) {
      const std::span<const std::uint32_t> same = ties.of(near.back.index[i]);
      Rgb sum{};
      for (const std::uint32_t j : same) add(sum, load_rgb(original, j));
      store(r, i, sum, static_cast<std::int64_t>(same.size()));
    } else {
      store(r, i, sums[i], counts[i]);
    }
  }
  return r;
}

Channel transfer_values(const Channel& original, const Nearest& back) {
  return gather(original, back.index);
}

SamePositions::SamePositions(std::span<const Vec3> points)
    : order_(points.size()), begin_(points.size()), end_(points.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return points[a] != points[b] ? points[a] < points[b] : a < b;
  });
  for (std::uint32_t begin = 0, end = 0; begin < order_.size(); begin = end) {
    while (end < order_.size() && points[order_[end]] == points[order_[begin]]) ++end;
    for (std::uint32_t i = begin; i < end; ++i) {
      begin_[order_[i]] = begin;
      end_[order_[i]] = end;
    }
  }
}

double color_error_between(const Channel& original, const Channel& decoded, const NearestPair& near,
                           const SamePositions& ties) {
  double forth = 0, back = 0;
  for (std::size_t i = 0; i < near.forth.index.size(); ++i) {
    forth += distance(load_rgb(original, i), load_rgb(decoded, near.forth.index[i]));
  }
  for (std::size_t i = 0; i < near.back.index.size(); ++i) {
    // Of originals at one position any may be taken for the nearest: what counts is the mean over them.
    const std::span<const std::uint32_t> same = ties.of(near.back.index[i]);
    double sum = 0;
    for (const std::uint32_t j : same) sum += distance(load_rgb(decoded, i), load_rgb(original, j));
    back += sum / static_cast<double>(same.size());
  }
  const double scale = original.info.scalar == ScalarType::u16 ? 257 : 1;
  return (forth / static_cast<double>(near.forth.index.size()) +
          back / static_cast<double>(near.back.index.size())) /
         (2 * scale);
}

}  // namespace mapcodec
