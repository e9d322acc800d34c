// SPDX-License-Identifier: GPL-3.0-or-later
#include <charconv>

#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/config/settings_table.hpp"

namespace mapcodec::daemon {
namespace {

/// A basic string of TOML: quotes, backslashes and control characters are escaped.
std::string quoted(const std::string& text) {
  constexpr const char* kHex = "0123456789ABCDEF";
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 32 || byte == 127) {
      out += std::string("\\u00") + kHex[byte >> 4] + kHex[byte & 15];
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string literal(const std::string& text) {
  return quoted(text);
}
std::string literal(bool value) {
  return value ? "true" : "false";
}
std::string literal(TokenPolicy policy) {
  return policy == TokenPolicy::required ? "\"required\"" : "\"remote\"";
}

std::string literal(const std::vector<std::string>& list) {
  std::string out = "[";
  for (const std::string& text : list) out += (out.size() > 1 ? ", " : "") + quoted(text);
  return out + "]";
}

/// The shortest digits that give the same number; with a point, as TOML wants of a float.
std::string literal(double value) {
  char digits[64];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  std::string out(digits, end);
  return out.find_first_of(".e") == out.npos ? out + ".0" : out;
}

template <class Integer>
requires std::is_integral_v<Integer> std::string literal(Integer value) {
  return std::to_string(value);
}

class Printer {
 public:
  void section(const char* name, const char* meaning) {
    text_ += std::string("\n# ") + meaning + "\n[" + name + "]\n";
  }
  template <class Value>
  void value(const char* key, const Value& value, const char* meaning, Range) {
    text_ += std::string("# ") + meaning + "\n" + key + " = " + literal(value) + "\n";
  }
  [[nodiscard]] std::string text() const {
    return "# Configuration of mapcodecd. Every key may be left out.\n" + text_;
  }

 private:
  std::string text_;
};

}  // namespace

std::string print_config(const DaemonSettings& settings) {
  Printer printer;
  visit_settings(settings, printer);
  return printer.text();
}

}  // namespace mapcodec::daemon
