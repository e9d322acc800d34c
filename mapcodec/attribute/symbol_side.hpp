// SPDX-License-Identifier: GPL-3.0-or-later
// The two ends of a range code behind one interface, so that syntax is written once: a function that takes a
// value and returns it, having written it, and its twin that ignores the value and returns what it reads.
#pragma once

#include "mapcodec/entropy/range_decoder.hpp"
#include "mapcodec/entropy/range_encoder.hpp"

namespace mapcodec {

class SymbolWriter {
 public:
  static constexpr bool kReads = false;
  bool bit(bool v, BitModel& m) {
    out_.encode(v, m);
    return v;
  }
  bool bit(bool v, std::uint32_t probability) {
    out_.encode(v, probability);
    return v;
  }
  std::uint64_t raw(std::uint64_t v, int count) {
    out_.encode_raw(v, count);
    return v;
  }
  [[nodiscard]] bool ok() const { return true; }
  [[nodiscard]] Bytes finish() { return out_.finish(); }

 private:
  RangeEncoder out_;
};

class SymbolReader {
 public:
  static constexpr bool kReads = true;
  explicit SymbolReader(ByteSpan bytes) : in_(bytes) {}
  bool bit(bool, BitModel& m) { return in_.decode(m); }
  bool bit(bool, std::uint32_t probability) { return in_.decode(probability); }
  std::uint64_t raw(std::uint64_t, int count) { return in_.decode_raw(count); }
  [[nodiscard]] bool ok() const { return in_.ok(); }
  [[nodiscard]] std::size_t left() const { return in_.left(); }  ///< bytes not read yet

 private:
  RangeDecoder in_;
};

}  // namespace mapcodec
