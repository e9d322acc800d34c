// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/ply.hpp"

namespace mapcodec {
namespace {

std::optional<ScalarType> scalar_of(std::string_view word) {
  static const struct {
    const char* name;
    ScalarType scalar;
  } kTypes[] = {{"char", ScalarType::i8},     {"int8", ScalarType::i8},     {"uchar", ScalarType::u8},
                {"uint8", ScalarType::u8},    {"short", ScalarType::i16},   {"int16", ScalarType::i16},
                {"ushort", ScalarType::u16},  {"uint16", ScalarType::u16},  {"int", ScalarType::i32},
                {"int32", ScalarType::i32},   {"uint", ScalarType::u32},    {"uint32", ScalarType::u32},
                {"float", ScalarType::f32},   {"float32", ScalarType::f32}, {"double", ScalarType::f64},
                {"float64", ScalarType::f64}, {"int64", ScalarType::i64},   {"uint64", ScalarType::u64}};
  for (const auto& t : kTypes) {
    if (word == t.name) return t.scalar;
  }
  return std::nullopt;
}

Status read_format(const Cursor& cursor, Words& words, PlyHeader& h) {
  std::string_view format, version;
  words.next(format);
  words.next(version);
  h.ascii = format == "ascii";
  h.big_endian = format == "binary_big_endian";
  if (!h.ascii && !h.big_endian && format != "binary_little_endian")
    return line_error(cursor, "PLY format " + quoted(format) + " is unknown");
  if (version != "1.0") return line_error(cursor, "PLY version " + quoted(version) + " is unknown");
  return {};
}

Status read_element(const Cursor& cursor, Words& words, PlyHeader& h) {
  std::string_view name, count;
  PlyElement e;
  words.next(name);
  if (!words.next(count) || !parse_number(count, e.count)) {
    return line_error(
        cursor, "element " + quoted(name) + " has no count" + (count.empty() ? "" : ": " + quoted(count)));
  }
  e.name = name;
  h.elements.push_back(std::move(e));
  return {};
}

Status read_property(const Cursor& cursor, Words& words, PlyHeader& h) {
  if (h.elements.empty()) return line_error(cursor, "property before any element");
  PlyProperty p;
  std::string_view type, name;
  words.next(type);
  if (type == "list") {
    words.next(type);
    p.list_count = scalar_of(type);
    if (!p.list_count || *p.list_count >= ScalarType::f32)
      return line_error(cursor, quoted(type) + " is no PLY type for a list's length");
    words.next(type);
  }
  const auto scalar = scalar_of(type);
  if (!scalar) return line_error(cursor, quoted(type) + " is no PLY type");
  if (!words.next(name)) return line_error(cursor, "property without a name");
  p.scalar = *scalar;
  p.name = name;
  h.elements.back().properties.push_back(std::move(p));
  return {};
}

Status read_line(const Cursor& cursor, std::string_view line, PlyHeader& h, bool& seen_format) {
  Words words(line);
  std::string_view key;
  words.next(key);
  if (key == "comment" || key == "obj_info" || key.empty()) return {};
  if (key == "format") {
    seen_format = true;
    return read_format(cursor, words, h);
  }
  if (key == "element") return read_element(cursor, words, h);
  if (key == "property") return read_property(cursor, words, h);
  return line_error(cursor, quoted(key) + " is no PLY header word");
}

}  // namespace

bool PlyElement::has_list() const {
  return std::any_of(properties.begin(), properties.end(),
                     [](const PlyProperty& p) { return p.list_count.has_value(); });
}

std::size_t PlyElement::stride() const {
  std::size_t n = 0;
  for (const PlyProperty& p : properties) n += scalar_size(p.scalar);
  return n;
}

Result<PlyHeader> read_ply_header(Cursor& cursor) {
  constexpr std::uint64_t kMaxHeaderLines = 10000;
  PlyHeader h;
  bool seen_format = false;
  std::string_view line;
  cursor.line(line);  // the magic, which brought us here
  while (cursor.line(line) && cursor.line_number() < kMaxHeaderLines) {
    if (line.starts_with("end_header")) {
      if (!seen_format) return line_error(cursor, "the PLY header has no format line");
      return h;
    }
    MAPCODEC_TRY(read_line(cursor, line, h, seen_format));
  }
  MAPCODEC_TRY(cursor.status());
  return make_error(ErrorCode::kTruncated, "the PLY header ends without end_header", cursor.offset());
}

}  // namespace mapcodec
