// SPDX-License-Identifier: GPL-3.0-or-later
// A named attribute of every point: what it is called, what it is made of, and its values.
#pragma once

#include <cstring>
#include <string>
#include <utility>

#include "mapcodec/base/bytes.hpp"

namespace mapcodec {

/// The ids are written to archives: never reuse one.
enum class ScalarType : std::uint8_t {
  u8 = 1,
  i8 = 2,
  u16 = 3,
  i16 = 4,
  u32 = 5,
  i32 = 6,
  u64 = 7,
  i64 = 8,
  f32 = 9,
  f64 = 10
};

/// Bytes of one scalar; 0 for an id that is none of the above.
[[nodiscard]] constexpr std::size_t scalar_size(ScalarType t) {
  constexpr std::size_t kSizes[] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
  const auto i = static_cast<std::size_t>(t);
  return i < std::size(kSizes) ? kSizes[i] : 0;
}
/// "u8", "f32", ...
[[nodiscard]] constexpr const char* scalar_name(ScalarType t) {
  constexpr const char* kNames[] = {"?", "u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"};
  const auto i = static_cast<std::size_t>(t);
  return i < std::size(kNames) ? kNames[i] : "?";
}

/// Conventional names: "rgb" (u8x3 or u16x3: red, green, blue), "alpha" (u8), "intensity", "normal" (f32x3 or
/// f64x3, unit), "time", "ring", "label". Any other name is kept as found.
struct ChannelInfo {
  std::string name;
  ScalarType scalar = ScalarType::f32;
  std::uint8_t components = 1;

  [[nodiscard]] std::size_t stride() const { return scalar_size(scalar) * components; }  ///< bytes per point
  /// "u8x3", "f32".
  [[nodiscard]] std::string type_name() const {
    return scalar_name(scalar) + (components > 1 ? "x" + std::to_string(components) : std::string());
  }
  bool operator==(const ChannelInfo&) const = default;
};

/// One value per point: `stride()` bytes each, little-endian scalars, components side by side.
struct Channel {
  ChannelInfo info;
  Bytes data;

  [[nodiscard]] std::size_t size() const { return info.stride() == 0 ? 0 : data.size() / info.stride(); }
  [[nodiscard]] std::uint8_t* at(std::size_t i) { return data.data() + i * info.stride(); }
  [[nodiscard]] const std::uint8_t* at(std::size_t i) const { return data.data() + i * info.stride(); }

  /// Component `c` of point `i`. T must be the C++ type of `info.scalar`.
  template <class T>
  [[nodiscard]] T get(std::size_t i, std::size_t c = 0) const {
    T v;
    std::memcpy(&v, at(i) + c * sizeof(T), sizeof(T));
    return v;
  }
  template <class T>
  void set(std::size_t i, T v, std::size_t c = 0) {
    std::memcpy(at(i) + c * sizeof(T), &v, sizeof(T));
  }
};

/// Calls `f(T{})` with T the C++ type of `t`, so that generic code is written once.
template <class F>
decltype(auto) visit_scalar(ScalarType t, F&& f) {
  switch (t) {
    case ScalarType::u8:
      return f(std::uint8_t{});
    case ScalarType::i8:
      return f(std::int8_t{});
    case ScalarType::u16:
      return f(std::uint16_t{});
    case ScalarType::i16:
      return f(std::int16_t{});
    case ScalarType::u32:
      return f(std::uint32_t{});
    case ScalarType::i32:
      return f(std::int32_t{});
    case ScalarType::u64:
      return f(std::uint64_t{});
    case ScalarType::i64:
      return f(std::int64_t{});
    case ScalarType::f32:
      return f(float{});
    case ScalarType::f64:
      break;
  }
  return f(double{});
}

}  // namespace mapcodec
