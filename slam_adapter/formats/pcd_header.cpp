// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <limits>

#include "slam_adapter/formats/pcd.hpp"
#include "slam_adapter/formats/text_number.hpp"

namespace mapcodec {
namespace {

using WordList = std::vector<std::string>;

/// The header's lines as read, before they are checked against each other.
struct RawHeader {
  WordList fields, sizes, types, counts, viewpoint;
  std::optional<std::uint64_t> width, height, points;
  std::string data;
};

Error at_line(const Cursor& cursor, const std::string& what) {
  return make_error(ErrorCode::kMalformed, "line " + std::to_string(cursor.line_number()) + ": " + what);
}

Status read_count(const Cursor& cursor, const std::string& key, const WordList& words,
                  std::optional<std::uint64_t>& to) {
  std::uint64_t v = 0;
  if (words.size() != 1 || !parse_number(std::string_view(words[0]), v)) {
    return at_line(cursor, key + " is not one whole number" + (words.empty() ? "" : ": " + quoted(words[0])));
  }
  to = v;
  return {};
}

Status read_key(const Cursor& cursor, const std::string& key, const WordList& words, RawHeader& h) {
  if (key == "FIELDS" || key == "COLUMNS")
    h.fields = words;
  else if (key == "SIZE")
    h.sizes = words;
  else if (key == "TYPE")
    h.types = words;
  else if (key == "COUNT")
    h.counts = words;
  else if (key == "WIDTH")
    return read_count(cursor, key, words, h.width);
  else if (key == "HEIGHT")
    return read_count(cursor, key, words, h.height);
  else if (key == "POINTS")
    return read_count(cursor, key, words, h.points);
  else if (key == "DATA")
    h.data = words.empty() ? "" : words[0];
  else if (key == "VIEWPOINT")
    h.viewpoint = words;
  else if (key != "VERSION")
    return at_line(cursor, quoted(key) + " is no PCD header word");
  return {};
}

Result<RawHeader> read_lines(Cursor& cursor) {
  constexpr std::uint64_t kMaxHeaderLines = 1000;
  RawHeader h;
  std::string_view line;
  while (cursor.content_line(line, true) && cursor.line_number() < kMaxHeaderLines) {
    Words words(line);
    std::string_view word;
    words.next(word);
    const std::string key(word);
    WordList list;
    while (words.next(word)) list.emplace_back(word);
    MAPCODEC_TRY(read_key(cursor, key, list, h));
    if (key == "DATA") return h;
  }
  MAPCODEC_TRY(cursor.status());
  return make_error(ErrorCode::kTruncated, "the PCD header ends without a DATA line", cursor.offset());
}

std::optional<ScalarType> scalar_of(const std::string& type, const std::string& size) {
  static const struct {
    const char *type, *size;
    ScalarType scalar;
  } kTypes[] = {{"U", "1", ScalarType::u8},  {"U", "2", ScalarType::u16}, {"U", "4", ScalarType::u32},
                {"U", "8", ScalarType::u64}, {"I", "1", ScalarType::i8},  {"I", "2", ScalarType::i16},
                {"I", "4", ScalarType::i32}, {"I", "8", ScalarType::i64}, {"F", "4", ScalarType::f32},
                {"F", "8", ScalarType::f64}};
  for (const auto& t : kTypes) {
    if (type == t.type && size == t.size) return t.scalar;
  }
  return std::nullopt;
}

Status add_field(const RawHeader& raw, std::size_t i, PcdHeader& h) {
  constexpr std::size_t kMaxStride = std::size_t{1} << 20;
  const std::string& name = raw.fields[i];
  const auto scalar = scalar_of(raw.types[i], raw.sizes[i]);
  if (!scalar) {
    return make_error(ErrorCode::kMalformed, "field " + quoted(name) + " has TYPE " + quoted(raw.types[i]) +
                                                 " SIZE " + quoted(raw.sizes[i]) +
                                                 ", which PCD does not define");
  }
  std::uint32_t count = 1;
  if (!raw.counts.empty() &&
      (!parse_number(std::string_view(raw.counts[i]), count) || count == 0 || count > kMaxStride)) {
    return make_error(ErrorCode::kMalformed, "field " + quoted(name) + " has COUNT " + quoted(raw.counts[i]));
  }
  h.fields.push_back({name, *scalar, count, h.stride});
  h.stride += scalar_size(*scalar) * count;
  if (h.stride > kMaxStride) return make_error(ErrorCode::kUnsupported, "has points of more than 1 MiB each");
  return {};
}

Result<std::uint64_t> point_count(const RawHeader& raw) {
  if (!raw.width) {
    if (raw.points) return *raw.points;
    return make_error(ErrorCode::kMalformed, "the PCD header has neither POINTS nor WIDTH");
  }
  const std::uint64_t height = raw.height.value_or(1);
  if (height != 0 && *raw.width > std::numeric_limits<std::uint64_t>::max() / height) {
    return make_error(ErrorCode::kMalformed, "WIDTH times HEIGHT overflows");
  }
  const std::uint64_t cells = *raw.width * height;
  if (raw.points && *raw.points != cells) {
    return make_error(ErrorCode::kMalformed, "POINTS is " + std::to_string(*raw.points) +
                                                 " but WIDTH times HEIGHT is " + std::to_string(cells));
  }
  return cells;
}

bool is_identity(const WordList& viewpoint) {
  constexpr double kIdentity[] = {0, 0, 0, 1, 0, 0, 0};
  return viewpoint.empty() || std::equal(viewpoint.begin(), viewpoint.end(), std::begin(kIdentity),
                                         std::end(kIdentity), [](const std::string& word, double wanted) {
                                           double v = 0;
                                           return parse_number(std::string_view(word), v) && v == wanted;
                                         });
}

std::string unkept(const RawHeader& raw) {
  const bool grid = raw.width && raw.height.value_or(1) > 1, viewpoint = !is_identity(raw.viewpoint);
  if (!grid && !viewpoint) return {};
  std::string r;
  if (grid) {
    r = "its grid of " + std::to_string(*raw.width) + " x " + std::to_string(*raw.height) + " points";
    if (viewpoint) r += " and ";
  }
  if (viewpoint) r += "its VIEWPOINT";
  return r + (grid && viewpoint ? " are not kept" : " is not kept");
}

}  // namespace

Result<PcdHeader> read_pcd_header(Cursor& cursor) {
  MAPCODEC_ASSIGN(const RawHeader raw, read_lines(cursor));
  PcdHeader h;
  if (raw.data == "binary")
    h.data = PcdHeader::Data::binary;
  else if (raw.data == "binary_compressed")
    h.data = PcdHeader::Data::compressed;
  else if (raw.data != "ascii")
    return at_line(cursor, "DATA " + quoted(raw.data) + " is none of ascii, binary, binary_compressed");
  const std::size_t n = raw.fields.size();
  if (n == 0) return make_error(ErrorCode::kMalformed, "the PCD header has no FIELDS");
  if (raw.sizes.size() != n || raw.types.size() != n || (!raw.counts.empty() && raw.counts.size() != n)) {
    return make_error(ErrorCode::kMalformed,
                      "FIELDS, SIZE, TYPE and COUNT of the PCD header have different lengths");
  }
  for (std::size_t i = 0; i < n; ++i) MAPCODEC_TRY(add_field(raw, i, h));
  MAPCODEC_ASSIGN(h.points, point_count(raw));
  if (h.points == 0) return make_error(ErrorCode::kEmpty, "holds no point (the PCD header announces 0)");
  h.unkept = unkept(raw);
  return h;
}

}  // namespace mapcodec
