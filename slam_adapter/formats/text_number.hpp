// SPDX-License-Identifier: GPL-3.0-or-later
// Words and numbers of text files; no locale, correctly rounded.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include "mapcodec/cloud/channel.hpp"

namespace mapcodec {

/// Splits a line at blanks and tabs, and at commas and semicolons where `table` says so.
class Words {
 public:
  explicit Words(std::string_view line, bool table = false) : rest_(line), table_(table) {}

  bool next(std::string_view& word) {
    std::size_t begin = 0;
    while (begin < rest_.size() && separates(rest_[begin])) ++begin;
    std::size_t end = begin;
    while (end < rest_.size() && !separates(rest_[end])) ++end;
    word = rest_.substr(begin, end - begin);
    rest_.remove_prefix(end);
    return !word.empty();
  }

 private:
  [[nodiscard]] bool separates(char c) const {
    return c == ' ' || c == '\t' || (table_ && (c == ',' || c == ';'));
  }
  std::string_view rest_;
  bool table_;
};

/// A decimal number of range beyond T (1e400, 1e-400) as infinity or zero; words of Microsoft's C library as
/// NaN.
[[nodiscard]] bool parse_odd_number(std::string_view word, double& value);

/// Parses the whole of `word` as a T. Integers may be written as 12.0.
template <class T>
[[nodiscard]] bool parse_number(std::string_view word, T& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error == std::errc() && stop == end) return true;
  double wide = 0;
  if constexpr (std::is_floating_point_v<T>) {
    if (!parse_odd_number(word, wide)) return false;
    value = static_cast<T>(wide);
    return true;
  } else {
    const auto [stop2, error2] = std::from_chars(word.data(), end, wide);
    if (error2 != std::errc() || stop2 != end || std::trunc(wide) != wide) return false;
    if (wide < double(std::numeric_limits<T>::min()) ||
        wide >= std::ldexp(1.0, std::numeric_limits<T>::digits))
      return false;
    value = static_cast<T>(wide);
    return true;
  }
}

/// Parses `word` into the bytes of a scalar of `type`.
[[nodiscard]] inline bool store_number(std::string_view word, ScalarType type, std::uint8_t* to) {
  return visit_scalar(type, [&](auto v) {
    if (!parse_number(word, v)) return false;
    std::memcpy(to, &v, sizeof(v));
    return true;
  });
}

/// Appends the shortest text that reads back as the same scalar.
inline void append_number(std::string& out, ScalarType type, const std::uint8_t* from) {
  visit_scalar(type, [&](auto v) {
    std::memcpy(&v, from, sizeof(v));
    char text[40];
    const auto r = std::to_chars(text, text + sizeof(text), v);
    out.append(text, r.ptr);
  });
}

/// `word` fit for a message: quoted, cut, and without what a terminal would obey.
[[nodiscard]] std::string quoted(std::string_view word);

}  // namespace mapcodec
