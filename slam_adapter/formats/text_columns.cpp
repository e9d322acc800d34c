// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/text_table.hpp"

namespace mapcodec {
namespace {

/// What the first lines say of one column.
struct Column {
  bool whole = true, float_digits = true;
  double min = 0, max = 0;
  void add(std::string_view word, double v);
  [[nodiscard]] bool within(double low, double high) const { return min >= low && max <= high; }
  [[nodiscard]] ScalarType type() const { return float_digits ? ScalarType::f32 : ScalarType::f64; }
};

void Column::add(std::string_view word, double v) {
  whole = whole && word.find_first_of(".eEnN") == std::string_view::npos;
  min = std::min(min, v);
  max = std::max(max, v);
  // The float's shortest text must name the same double.
  char text[40];
  const auto r = std::to_chars(text, text + sizeof(text), static_cast<float>(v));
  double again = 0;
  std::from_chars(text, r.ptr, again);
  float_digits = float_digits && (again == v || std::isnan(v));
}

Result<std::vector<Column>> sample(PointLines& lines) {
  constexpr int kLines = 4096;
  std::vector<Column> columns;
  std::string_view line, word;
  for (int i = 0; i < kLines; ++i) {
    MAPCODEC_ASSIGN(const bool more, lines.next(line));
    if (!more) break;
    Words words(line, true);
    for (std::size_t c = 0; words.next(word); ++c) {
      double v = 0;
      if (!parse_number(word, v)) return line_error(lines.cursor(), quoted(word) + " is no number");
      if (i == 0 && c < 256) columns.emplace_back();
      if (c < columns.size()) columns[c].add(word, v);
    }
    if (i == 0 && columns.size() < 3)
      return line_error(lines.cursor(), quoted(line) + " has fewer than three numbers");
  }
  if (columns.empty()) return make_error(ErrorCode::kEmpty, "holds no point");
  return columns;
}

/// A colour if the three columns from `first` on hold whole numbers of 8 or 16 bits.
std::optional<ScalarType> color_type(const std::vector<Column>& c, std::size_t first) {
  double limit = 0;
  for (std::size_t i = first; i < first + 3; ++i) {
    if (!c[i].whole || !c[i].within(0, 65535)) return std::nullopt;
    limit = std::max(limit, c[i].max);
  }
  return limit <= 255 ? ScalarType::u8 : ScalarType::u16;
}

struct Named {
  std::string name;
  std::optional<ScalarType> type;
};

void append_color(std::vector<Named>& names, ScalarType type) {
  for (const char* n : {"red", "green", "blue"}) names.push_back({n, type});
}

/// Names by convention for columns without a header.
std::vector<Named> names_by_count(const std::vector<Column>& c) {
  std::vector<Named> r = {{"x", ScalarType::f64}, {"y", ScalarType::f64}, {"z", ScalarType::f64}};
  const std::size_t n = c.size();
  if (n == 4) r.push_back({"intensity", std::nullopt});
  if (n == 6) {
    const auto unit = [](const Column& v) { return v.within(-1.001, 1.001); };
    if (const auto type = color_type(c, 3))
      append_color(r, *type);
    else if (std::all_of(c.begin() + 3, c.end(), unit)) {
      for (const char* name : {"nx", "ny", "nz"}) r.push_back({name, ScalarType::f32});
    }
  }
  if (n == 7) {
    const auto last = color_type(c, 4), middle = color_type(c, 3);
    if (last) r.push_back({"intensity", std::nullopt});
    if (last || middle) append_color(r, last ? *last : *middle);
    if (!last && middle) r.push_back({"intensity", std::nullopt});
  }
  while (r.size() < n) r.push_back({"column_" + std::to_string(r.size() + 1), std::nullopt});
  return r;
}

std::optional<ScalarType> type_called(std::string_view name) {
  for (int t = 1; t <= 10; ++t) {
    if (name == scalar_name(static_cast<ScalarType>(t))) return static_cast<ScalarType>(t);
  }
  return std::nullopt;
}

/// "name" or "name:type" of a header line.
Named read_name(const std::string& word) {
  const std::size_t colon = word.rfind(':');
  if (colon != std::string::npos) {
    if (const auto type = type_called(std::string_view(word).substr(colon + 1)))
      return {word.substr(0, colon), type};
  }
  return {word, std::nullopt};
}

std::vector<Named> names_from_header(const std::vector<std::string>& header) {
  std::vector<Named> names;
  for (const std::string& word : header) names.push_back(read_name(word));
  for (Named& n : names) {
    const bool coordinate = n.name == "x" || n.name == "y" || n.name == "z";
    if (coordinate && !n.type) n.type = ScalarType::f64;
  }
  return names;
}

/// r, g, b by any name, where the numbers are whole.
void resolve_colors(std::vector<Named>& names, const std::vector<Column>& columns) {
  for (std::size_t i = 0; i + 2 < names.size(); ++i) {
    const bool words = names[i].name == "red" && names[i + 1].name == "green" && names[i + 2].name == "blue";
    const bool letters = names[i].name == "r" && names[i + 1].name == "g" && names[i + 2].name == "b";
    const auto type = words || letters ? color_type(columns, i) : std::nullopt;
    for (std::size_t k = 0; k < 3 && type && !names[i + k].type; ++k) {
      names[i + k] = {k == 0 ? "red" : k == 1 ? "green" : "blue", type};
    }
  }
}

}  // namespace

std::string column_key(std::string_view word) {
  std::string lower(word);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  const std::string_view name = std::string_view(lower).substr(0, lower.find(':'));
  for (const char* known :
       {"x", "y", "z", "r", "g", "b", "red", "green", "blue", "nx", "ny", "nz", "intensity"}) {
    if (name == known) return lower;
  }
  return std::string(word);
}

Result<std::vector<RecordField>> guess_columns(PointLines lines, const std::vector<std::string>& header) {
  MAPCODEC_ASSIGN(const std::vector<Column> columns, sample(lines));
  std::vector<Named> names =
      header.size() == columns.size() ? names_from_header(header) : names_by_count(columns);
  resolve_colors(names, columns);
  std::vector<RecordField> fields;
  std::size_t offset = 0;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const ScalarType type = names[c].type.value_or(columns[c].type());
    fields.push_back({names[c].name, type, 1, offset});
    offset += scalar_size(type);
  }
  return fields;
}

}  // namespace mapcodec
