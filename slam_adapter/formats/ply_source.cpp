// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <limits>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/byte_order.hpp"
#include "slam_adapter/formats/ply.hpp"

namespace mapcodec {
namespace {

Error ends_in(const Cursor& cursor, const PlyElement& e, std::uint64_t found) {
  return make_error(ErrorCode::kTruncated,
                    "announces " + std::to_string(e.count) + " of " + quoted(e.name) + ", but ends after " +
                        std::to_string(found),
                    cursor.offset());
}

/// Passes one binary scalar and gives it as a list's length; none at the end of the file or if negative.
std::optional<std::uint64_t> take_length(Cursor& cursor, ScalarType type, bool big_endian) {
  std::uint8_t bytes[8];
  const ByteSpan taken = cursor.take(scalar_size(type));
  if (taken.size() < scalar_size(type)) return std::nullopt;
  std::copy(taken.begin(), taken.end(), bytes);
  if (big_endian) std::reverse(bytes, bytes + taken.size());
  return visit_scalar(type, [&](auto v) -> std::optional<std::uint64_t> {
    std::memcpy(&v, bytes, sizeof(v));
    if (v < 0) return std::nullopt;
    return static_cast<std::uint64_t>(v);
  });
}

/// Reads one binary element; its scalars go to `row` if there is one. False at the end of the file.
bool take_element(Cursor& cursor, const PlyElement& e, bool big_endian, std::uint8_t* row) {
  for (const PlyProperty& p : e.properties) {
    const std::size_t size = scalar_size(p.scalar);
    if (p.list_count) {
      const auto length = take_length(cursor, *p.list_count, big_endian);
      if (!length || *length > cursor.left() / size) return false;
      cursor.skip(*length * size);
      continue;
    }
    const ByteSpan taken = cursor.take(size);
    if (taken.size() < size) return false;
    if (row != nullptr) row = std::copy(taken.begin(), taken.end(), row);
  }
  return true;
}

/// Passes the elements before the vertices.
Status skip_binary(Cursor& cursor, const PlyElement& e, bool big_endian) {
  if (!e.has_list()) {
    const std::size_t stride = e.stride();
    if (stride > 0 && e.count > cursor.left() / stride) return ends_in(cursor, e, cursor.left() / stride);
    cursor.skip(e.count * stride);
    return {};
  }
  for (std::uint64_t i = 0; i < e.count; ++i) {
    if (!take_element(cursor, e, big_endian, nullptr)) return ends_in(cursor, e, i);
  }
  return cursor.status();
}

Status skip_ascii(Cursor& cursor, const PlyElement& e) {
  std::string_view line;
  if (e.properties.empty()) return {};
  for (std::uint64_t i = 0; i < e.count; ++i) {
    if (!cursor.content_line(line, false)) return ends_in(cursor, e, i);
  }
  return {};
}

/// The line without its lists, so that what is left is one number per scalar property.
Status drop_lists(const Cursor& cursor, const PlyElement& e, std::string_view line, std::string& out) {
  Words words(line);
  std::string_view word;
  out.clear();
  for (const PlyProperty& p : e.properties) {
    std::uint64_t length = 0;
    if (!words.next(word)) return line_error(cursor, "has too few numbers (none for " + quoted(p.name) + ")");
    if (!p.list_count)
      out.append(word).push_back(' ');
    else if (!parse_number(word, length))
      return line_error(cursor, quoted(word) + " is no length of the list " + quoted(p.name));
    for (std::uint64_t i = 0; i < length; ++i) {
      if (!words.next(word)) return line_error(cursor, "the list " + quoted(p.name) + " is too short");
    }
  }
  if (words.next(word))
    return line_error(cursor, "has more numbers than properties, from " + quoted(word) + " on");
  return {};
}

std::vector<RecordField> fields_of(const PlyElement& vertex, std::size_t& stride) {
  std::vector<RecordField> fields;
  for (const PlyProperty& p : vertex.properties) {
    if (p.list_count) continue;
    std::string name = p.name;
    if (name.starts_with("diffuse_")) name.erase(0, 8);
    fields.push_back({name, p.scalar, 1, stride});
    stride += scalar_size(p.scalar);
  }
  return fields;
}

class PlyReader final : public RecordReader {
 public:
  PlyReader(PlyHeader header, std::size_t vertex, const Cursor& body, std::vector<RecordField> fields,
            RecordPlan plan)
      : header_(std::move(header)),
        vertex_(vertex),
        fields_(std::move(fields)),
        plan_(std::move(plan)),
        body_(body),
        cursor_(body) {}

  [[nodiscard]] const RecordPlan& plan() const override { return plan_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override { return vertex().count; }
  void rewind() override {
    cursor_ = body_;
    done_ = 0;
  }
  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    auto n = header_.ascii         ? read_ascii(rows, max)
             : vertex().has_list() ? read_lists(rows, max)
                                   : read_plain(rows, max);
    if (!n.ok()) return n;
    done_ += *n;
    if (*n == 0) MAPCODEC_TRY(check_rest());
    if (header_.big_endian) swap_fields(fields_, plan_.stride, rows, *n);
    return n;
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    if (!vertex().has_list()) return {};
    return {"list properties of the vertices are not kept"};
  }

 private:
  [[nodiscard]] const PlyElement& vertex() const { return header_.elements[vertex_]; }

  Result<std::size_t> read_plain(std::uint8_t* rows, std::size_t max) {
    return read_records(cursor_, vertex().count - done_, plan_.stride, rows, max);
  }
  Result<std::size_t> read_lists(std::uint8_t* rows, std::size_t max) {
    std::size_t n = 0;
    for (; n < max && done_ + n < vertex().count; ++n) {
      if (!take_element(cursor_, vertex(), header_.big_endian, rows + n * plan_.stride))
        return ends_in(cursor_, vertex(), done_ + n);
    }
    return n;
  }
  Result<std::size_t> read_ascii(std::uint8_t* rows, std::size_t max) {
    std::size_t n = 0;
    const bool lists = vertex().has_list();
    for (; n < max && done_ + n < vertex().count; ++n) {
      std::string_view line;
      if (!cursor_.content_line(line, false)) {
        MAPCODEC_TRY(cursor_.status());
        return too_few_lines(cursor_, vertex().count, done_ + n);
      }
      if (lists) {
        MAPCODEC_TRY(drop_lists(cursor_, vertex(), line, scratch_));
        line = scratch_;
      }
      MAPCODEC_TRY(parse_row(cursor_, line, fields_, rows + n * plan_.stride));
    }
    return n;
  }

  /// After the vertices: the other elements, then nothing.
  Status check_rest() {
    Cursor rest = cursor_;
    for (std::size_t i = vertex_ + 1; i < header_.elements.size(); ++i) {
      const PlyElement& e = header_.elements[i];
      MAPCODEC_TRY(header_.ascii ? skip_ascii(rest, e) : skip_binary(rest, e, header_.big_endian));
    }
    if (header_.ascii) {
      std::string_view line;
      if (!rest.content_line(line, false)) return rest.status();
      return line_error(rest, "more data follows the elements that the header announces");
    }
    if (rest.left() == 0) return {};
    return make_error(ErrorCode::kMalformed,
                      std::to_string(rest.left()) + " bytes follow the elements that the header announces",
                      rest.offset());
  }

  PlyHeader header_;
  std::size_t vertex_;
  std::vector<RecordField> fields_;
  RecordPlan plan_;
  Cursor body_, cursor_;  ///< body_ stays at the first vertex
  std::uint64_t done_ = 0;
  std::string scratch_;
};

/// The body against the vertex count, before anybody believes it.
Status check_body(const Cursor& cursor, const PlyHeader& h, const PlyElement& vertex, std::size_t numbers,
                  std::size_t stride, bool last) {
  if (vertex.count == 0)
    return make_error(ErrorCode::kEmpty, "holds no point (the PLY header announces 0 vertices)");
  if (h.ascii) return check_text_size(cursor, vertex.count, numbers);
  return last && !vertex.has_list() ? check_exact_size(cursor, vertex.count, stride)
                                    : check_enough(cursor, vertex.count, stride);
}

}  // namespace

ReaderResult open_ply(const ByteStream& stream) {
  Cursor cursor(stream);
  MAPCODEC_ASSIGN(PlyHeader h, read_ply_header(cursor));
  std::size_t v = 0;
  for (; v < h.elements.size() && h.elements[v].name != "vertex"; ++v) {
    MAPCODEC_TRY(h.ascii ? skip_ascii(cursor, h.elements[v])
                         : skip_binary(cursor, h.elements[v], h.big_endian));
  }
  if (v == h.elements.size())
    return make_error(ErrorCode::kEmpty, "holds no point (the PLY header has no element vertex)");
  std::size_t stride = 0;
  std::vector<RecordField> fields = fields_of(h.elements[v], stride);
  MAPCODEC_ASSIGN(RecordPlan plan, RecordPlan::from_fields(fields, stride, false));
  MAPCODEC_TRY(check_body(cursor, h, h.elements[v], fields.size(), stride, v + 1 == h.elements.size()));
  return std::unique_ptr<RecordReader>(
      std::make_unique<PlyReader>(std::move(h), v, cursor, std::move(fields), std::move(plan)));
}

}  // namespace mapcodec
