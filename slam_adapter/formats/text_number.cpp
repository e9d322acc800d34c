// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/text_number.hpp"

#include <algorithm>
#include <limits>

namespace mapcodec {
namespace {

bool is_microsoft_nan(std::string_view word) {
  if (!word.empty() && word.front() == '-') word.remove_prefix(1);
  return word.starts_with("1.#");
}

/// Whether the decimal `word`, known to be out of range, is too small (and not too large): the exponent's
/// sign tells, and without exponent only leading zeros after the point can make it small.
bool is_tiny(std::string_view word) {
  const std::size_t e = word.find_first_of("eE");
  if (e != std::string_view::npos && e + 1 < word.size()) return word[e + 1] == '-';
  const std::size_t digit = word.find_first_of("123456789.");
  return digit != std::string_view::npos && word[digit] == '.';
}

}  // namespace

bool parse_odd_number(std::string_view word, double& value) {
  if (is_microsoft_nan(word)) {
    value = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (stop != end || word.empty()) return false;
  if (error == std::errc()) return true;
  if (error != std::errc::result_out_of_range) return false;
  value = is_tiny(word) ? 0.0 : std::numeric_limits<double>::infinity();
  if (word.front() == '-') value = -value;
  return true;
}

std::string quoted(std::string_view word) {
  std::string r(word.substr(0, 40));
  std::replace_if(
      r.begin(), r.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return "'" + r + (word.size() > 40 ? "...'" : "'");
}

}  // namespace mapcodec
