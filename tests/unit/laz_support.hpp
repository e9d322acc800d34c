// SPDX-License-Identifier: GPL-3.0-or-later
// A writer of LAZ for tests: the coders of the LAZ specification from the encoder's side, by the plainest
// choice wherever the format leaves one.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "slam_adapter/formats/laz_items.hpp"

namespace mapcodec::laz_test {

class Symbols {
 public:
  explicit Symbols(unsigned n = 256) : counts(n, 1), sums(n), cycle(n) {
    update();
    cycle = left = (n + 6) / 2;
  }
  void update() {
    total += cycle;
    if (total > 32768) {
      total = 0;
      for (auto& c : counts) total += c = (c + 1) / 2;
    }
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      sums[i] = (0x80000000u / total * sum) >> 16;
      sum += counts[i];
    }
    left = cycle = std::min<std::uint32_t>(5 * cycle / 4, static_cast<std::uint32_t>(counts.size() + 6) * 8);
  }
  std::vector<std::uint32_t> counts, sums;
  std::uint32_t total = 0, cycle = 0, left = 0;
};

struct BitModel {
  std::uint32_t zeros = 1, total = 2, share = 4096, cycle = 4, left = 4;
  void update() {
    total += cycle;
    if (total > 8192) {
      total = (total + 1) / 2;
      zeros = (zeros + 1) / 2;
      if (zeros == total) ++total;
    }
    share = (zeros * (0x80000000u / total)) >> 18;
    left = cycle = std::min(5 * cycle / 4, 64u);
  }
};

class Encoder {
 public:
  void symbol(Symbols& m, std::uint32_t s) {
    const std::uint32_t unit = length_ >> 15;
    const std::uint32_t low = m.sums[s] * unit;
    const std::uint32_t high = s + 1 == m.sums.size() ? length_ : m.sums[s + 1] * unit;
    narrow(low, high - low);
    ++m.counts[s];
    if (--m.left == 0) m.update();
  }
  void bit(BitModel& m, bool one) {
    const std::uint32_t middle = m.share * (length_ >> 13);
    narrow(one ? middle : 0, one ? length_ - middle : middle);
    if (!one) ++m.zeros;
    if (--m.left == 0) m.update();
  }
  void bits(unsigned count, std::uint32_t v) {
    if (count > 19) {
      bits(16, v & 0xffff);
      return bits(count - 16, v >> 16);
    }
    const std::uint32_t unit = length_ >> count;
    narrow(v * unit, unit);
  }
  void u32(std::uint32_t v) {
    bits(16, v & 0xffff);
    bits(16, v >> 16);
  }
  [[nodiscard]] std::string finish() {
    narrow(length_ / 2, 1u << 8);
    return out_ + std::string(4, '\0');
  }

 private:
  void narrow(std::uint32_t low, std::uint32_t length) {
    const std::uint32_t before = base_;
    base_ += low;
    length_ = length;
    if (base_ < before) {
      std::size_t i = out_.size();
      while (static_cast<unsigned char>(out_[--i]) == 0xff) out_[i] = 0;
      out_[i] = static_cast<char>(out_[i] + 1);
    }
    while (length_ < 1u << 24) {
      out_.push_back(static_cast<char>(base_ >> 24));
      base_ <<= 8;
      length_ <<= 8;
    }
  }
  std::string out_;
  std::uint32_t base_ = 0, length_ = 0xffffffff;
};

class Integers {
 public:
  explicit Integers(unsigned bits = 32, unsigned contexts = 1)
      : bits_(bits), lengths(contexts, Symbols(bits + 1)) {
    for (unsigned i = 1; i <= bits; ++i) corrections.emplace_back(1u << std::min(i, 8u));
  }
  void put(Encoder& to, std::int32_t prediction, std::int32_t value, std::size_t context = 0) {
    std::int64_t c = std::int64_t{value} - prediction;
    const std::int64_t range = std::int64_t{1} << bits_;
    if (c < -range / 2) c += range;
    if (c > range / 2 - 1) c -= range;
    k = 0;
    for (std::int64_t m = c <= 0 ? -c : c - 1; m > 0; m /= 2) ++k;
    to.symbol(lengths[context], k);
    if (k == 0) return to.bit(zero, c == 1);
    if (k == 32) return;
    c += c < 0 ? (std::int64_t{1} << k) - 1 : -1;
    const unsigned rest = k > 8 ? k - 8 : 0;
    to.symbol(corrections[k - 1], static_cast<std::uint32_t>(c >> rest));
    if (rest > 0) to.bits(rest, static_cast<std::uint32_t>(c) & ((1u << rest) - 1));
  }
  unsigned k = 0;

 private:
  unsigned bits_;
  std::vector<Symbols> lengths;
  BitModel zero;
  std::vector<Symbols> corrections;
};

template <class T>
void put(std::string& to, T v) {
  to.append(reinterpret_cast<const char*>(&v), sizeof(T));
}
template <class T>
T get(const std::string& from, std::size_t at) {
  T v;
  std::memcpy(&v, from.data() + at, sizeof(T));
  return v;
}
inline std::uint8_t u8(const std::string& s, std::size_t at) {
  return static_cast<std::uint8_t>(s[at]);
}

/// Position of both generations: medians of differences, contexts by bits.
struct Xyz {
  std::array<LazMedian, 16> x, y;
  std::array<std::int32_t, 8> heights{};
  Integers dx{32, 2}, dy{32, 22}, z{32, 20};
  void put_xy(Encoder& to, const std::string& a, const std::string& b, std::size_t map, std::size_t single) {
    const auto ddx = get<std::int32_t>(b, 0) - get<std::int32_t>(a, 0),
               ddy = get<std::int32_t>(b, 4) - get<std::int32_t>(a, 4);
    dx.put(to, x[map].get(), ddx, single);
    x[map].add(ddx);
    dy.put(to, y[map].get(), ddy, single + even_bits(dx.k, 20));
    y[map].add(ddy);
  }
  void put_z(Encoder& to, const std::string& b, std::size_t level, std::size_t single) {
    z.put(to, heights[level], get<std::int32_t>(b, 8), single + even_bits((dx.k + dy.k) / 2, 18));
    heights[level] = get<std::int32_t>(b, 8);
  }
};

/// Times always whole, after one symbol.
struct Times {
  Symbols zero;
  Integers upper{32, 9};
  std::uint32_t whole;
  explicit Times(bool first_generation) : zero(first_generation ? 6 : 5), whole(first_generation ? 2 : 1) {}
  void put(Encoder& to, std::uint64_t before, std::uint64_t now) {
    to.symbol(zero, whole);
    upper.put(to, static_cast<std::int32_t>(before >> 32), static_cast<std::int32_t>(now >> 32), 8);
    to.u32(static_cast<std::uint32_t>(now));
  }
};

struct Colors {
  Symbols changed{128};
  std::array<Symbols, 6> models;
  void put(Encoder& to, const std::string& a, const std::string& b, std::size_t at) {
    to.symbol(changed, 127);
    int was[3][2], is[3][2];
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t h = 0; h < 2; ++h) {
        was[c][h] = u8(a, at + 2 * c + h);
        is[c][h] = u8(b, at + 2 * c + h);
      }
    }
    const auto correct = [&](std::size_t model, int value, int prediction) {
      to.symbol(models[model], static_cast<std::uint32_t>(value - std::clamp(prediction, 0, 255)) & 255);
    };
    for (std::size_t h = 0; h < 2; ++h) correct(h, is[0][h], was[0][h]);
    for (std::size_t h = 0; h < 2; ++h) {
      const int moved = is[0][h] - was[0][h];
      correct(2 + h, is[1][h], moved + was[1][h]);
      correct(4 + h, is[2][h], (moved + is[1][h] - was[1][h]) / 2 + was[2][h]);
    }
  }
};

/// Point format 3 with extra bytes; return number and number of returns are 1.
inline std::string pointwise_chunk(const std::vector<std::string>& rows) {
  Encoder to;
  Xyz xyz;
  Times times(true);
  Colors colors;
  std::vector<Symbols> bytes(rows[0].size() - 34);
  Symbols changed(64);
  std::array<Symbols, 256> classes;
  Integers intensities(16, 4);
  std::uint16_t intensity = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const std::string &a = rows[i - 1], &b = rows[i];
    to.symbol(changed, 16 + 8);
    intensities.put(to, intensity, get<std::uint16_t>(b, 12), 0);
    intensity = get<std::uint16_t>(b, 12);
    to.symbol(classes[u8(a, 15)], u8(b, 15));
    xyz.put_xy(to, a, b, 0, 1);
    xyz.put_z(to, b, 0, 1);
    times.put(to, get<std::uint64_t>(a, 20), get<std::uint64_t>(b, 20));
    colors.put(to, a, b, 28);
    for (std::size_t k = 0; k < bytes.size(); ++k) to.symbol(bytes[k], (u8(b, 34 + k) - u8(a, 34 + k)) & 255);
  }
  return rows[0] + to.finish();
}

/// Point format 7 with extra bytes, one channel, one return; the class flags never change, so have no layer.
inline std::string layered_chunk(const std::vector<std::string>& rows) {
  const std::size_t extra = rows[0].size() - 36;
  std::vector<Encoder> layers(9 + 1 + extra);
  Xyz xyz;
  xyz.heights.fill(get<std::int32_t>(rows[0], 8));
  Times times(false);
  Colors colors;
  std::vector<Symbols> bytes(extra);
  std::vector<Symbols> changed(8, Symbols(128));
  std::array<Symbols, 64> classes, users;
  Integers intensities(16, 4), angles(16, 2), sources(16, 1);
  std::uint16_t intensity[2] = {get<std::uint16_t>(rows[0], 12), get<std::uint16_t>(rows[0], 12)};
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const std::string &a = rows[i - 1], &b = rows[i];
    const bool later = get<std::uint64_t>(a, 22) != get<std::uint64_t>(b, 22);
    const bool before = i > 1 && get<std::uint64_t>(rows[i - 2], 22) != get<std::uint64_t>(a, 22);
    layers[0].symbol(changed[3 + (before ? 4 : 0)], 32 + 8 + (later ? 16 : 0));
    xyz.put_xy(layers[0], a, b, later ? 1 : 0, 1);
    xyz.put_z(layers[1], b, 0, 1);
    layers[2].symbol(classes[(u8(a, 16) & 31) * 2 + 1], u8(b, 16));
    intensities.put(layers[4], intensity[later ? 1 : 0], get<std::uint16_t>(b, 12), 3);
    intensity[later ? 1 : 0] = get<std::uint16_t>(b, 12);
    angles.put(layers[5], get<std::int16_t>(a, 18), get<std::int16_t>(b, 18), later ? 1 : 0);
    layers[6].symbol(users[u8(a, 17) / 4], u8(b, 17));
    sources.put(layers[7], get<std::uint16_t>(a, 20), get<std::uint16_t>(b, 20));
    if (later) times.put(layers[8], get<std::uint64_t>(a, 22), get<std::uint64_t>(b, 22));
    colors.put(layers[9], a, b, 30);
    for (std::size_t k = 0; k < extra; ++k)
      layers[10 + k].symbol(bytes[k], (u8(b, 36 + k) - u8(a, 36 + k)) & 255);
  }
  std::string r = rows[0], body;
  put(r, static_cast<std::uint32_t>(rows.size()));
  for (std::size_t l = 0; l < layers.size(); ++l) {
    const std::string bytes_of = l == 3 ? std::string() : layers[l].finish();
    put(r, static_cast<std::uint32_t>(bytes_of.size()));
    body += bytes_of;
  }
  return r + body;
}

struct Item {
  std::uint16_t type, size, version;
};
struct File {
  unsigned minor = 2, format = 3, compressor = 2;
  std::size_t stride = 34;
  std::uint32_t chunk_points = 0xffffffff;
  std::vector<Item> items;
  std::vector<std::pair<std::uint32_t, std::string>> chunks;  ///< points and bytes
  bool table_at_end = false;  ///< its place stands behind it, as in files that were written to a pipe
};

/// Scale 0.01, offset 100.
inline std::string write_laz(const File& f) {
  const std::size_t header = f.minor == 4 ? 375 : 227, vlr = 54 + 34 + 6 * f.items.size();
  std::uint32_t points = 0;
  for (const auto& c : f.chunks) points += c.first;
  std::string r(header, '\0');
  const auto set = [&](std::size_t at, auto v) { std::memcpy(r.data() + at, &v, sizeof(v)); };
  r.replace(0, 4, "LASF");
  r[24] = 1;
  r[25] = static_cast<char>(f.minor);
  set(94, static_cast<std::uint16_t>(header));
  set(96, static_cast<std::uint32_t>(header + vlr));
  set(100, std::uint32_t{1});
  r[104] = static_cast<char>(f.format | 0x80);
  set(105, static_cast<std::uint16_t>(f.stride));
  set(107, f.minor == 4 ? 0u : points);
  for (std::size_t d = 0; d < 3; ++d) set(131 + 8 * d, 0.01), set(155 + 8 * d, 100.0);
  if (f.minor == 4) set(247, std::uint64_t{points});
  std::string record(54, '\0');
  record.replace(2, 14, "laszip encoded");
  const std::uint16_t id = 22204, size = static_cast<std::uint16_t>(vlr - 54);
  std::memcpy(record.data() + 18, &id, 2);
  std::memcpy(record.data() + 20, &size, 2);
  put(record, static_cast<std::uint16_t>(f.compressor));
  put(record, std::uint16_t{0});
  record += std::string(8, '\0');
  put(record, f.chunk_points);
  put(record, std::int64_t{-1});
  put(record, std::int64_t{-1});
  put(record, static_cast<std::uint16_t>(f.items.size()));
  for (const Item& i : f.items) put(record, i.type), put(record, i.size), put(record, i.version);
  r += record;
  if (f.compressor == 1) return r + f.chunks.front().second;
  std::uint64_t table = r.size() + 8;
  for (const auto& c : f.chunks) table += c.second.size();
  put(r, f.table_at_end ? std::uint64_t(-1) : table);
  Encoder to;
  Integers numbers(32, 2);
  std::int32_t last_points = 0, last_size = 0;
  for (const auto& [n, bytes] : f.chunks) {
    r += bytes;
    if (f.chunk_points == 0xffffffff) numbers.put(to, last_points, static_cast<std::int32_t>(n), 0);
    numbers.put(to, last_size, static_cast<std::int32_t>(bytes.size()), 1);
    last_points = static_cast<std::int32_t>(n);
    last_size = static_cast<std::int32_t>(bytes.size());
  }
  put(r, std::uint32_t{0});
  put(r, static_cast<std::uint32_t>(f.chunks.size()));
  r += to.finish();
  if (f.table_at_end) put(r, table);
  return r;
}

/// Records of format 3 or 7 with `extra` bytes that wander, jump and stay.
inline std::vector<std::string> rows(unsigned format, std::size_t count, std::size_t extra, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::string> r;
  std::int32_t p[3] = {1000, -2000, 300};
  std::uint64_t time = 0x4110000000000000;
  for (std::size_t i = 0; i < count; ++i) {
    for (auto& v : p) v += static_cast<std::int32_t>(random() % 41) - 20 + (random() % 50 == 0 ? 100000 : 0);
    if (random() % 3 == 0) time += random();
    std::string row;
    for (const auto v : p) put(row, v);
    put(row, static_cast<std::uint16_t>(random() % 300 + (i % 64 == 0 ? 60000 : 0)));
    if (format == 3) {
      row += std::string("\x09", 1) + static_cast<char>(random() % 7) + std::string(4, '\5');
    } else {
      row +=
          std::string("\x11\x40", 2) + static_cast<char>(random() % 40) + static_cast<char>(random() % 200);
      put(row, static_cast<std::int16_t>(int(random() % 2000) - 1000));
      put(row, static_cast<std::uint16_t>(random() % 5));
    }
    put(row, time);
    for (int c = 0; c < 3; ++c) put(row, static_cast<std::uint16_t>(random() % 600 + 1000 * c));
    for (std::size_t e = 0; e < extra; ++e) row.push_back(static_cast<char>(random() % 9 + i / 5));
    r.push_back(row);
  }
  return r;
}

inline File pointwise_file(std::size_t extra) {
  File f;
  f.stride = 34 + extra;
  f.items = {{6, 20, 2}, {7, 8, 2}, {8, 6, 2}};
  if (extra > 0) f.items.push_back({0, static_cast<std::uint16_t>(extra), 2});
  return f;
}
inline File layered_file(std::size_t extra) {
  File f;
  f.minor = 4;
  f.format = 7;
  f.compressor = 3;
  f.stride = 36 + extra;
  f.items = {{10, 30, 3}, {11, 6, 3}};
  if (extra > 0) f.items.push_back({14, static_cast<std::uint16_t>(extra), 3});
  return f;
}

}  // namespace mapcodec::laz_test
