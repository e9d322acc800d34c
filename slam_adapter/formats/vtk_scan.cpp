// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "slam_adapter/formats/ascii_rows.hpp"
#include "slam_adapter/formats/vtk.hpp"

namespace mapcodec {
namespace {

using WordList = std::vector<std::string>;

/// Walks through the sections; each knows how many values it has, so that nothing is searched for.
class Scanner {
 public:
  explicit Scanner(Cursor& cursor) : cursor_(cursor) {}

  Result<VtkFile> run() {
    MAPCODEC_TRY(read_head());
    WordList words;
    while (next_words(words)) MAPCODEC_TRY(section(words));
    MAPCODEC_TRY(cursor_.status());
    if (file_.points == 0) return make_error(ErrorCode::kEmpty, "holds no point (no POINTS in the VTK file)");
    return std::move(file_);
  }

 private:
  Status read_head() {
    std::string_view line;
    cursor_.line(line);
    cursor_.line(line);  // title
    if (!cursor_.line(line))
      return make_error(ErrorCode::kTruncated, "ends within the VTK header", cursor_.offset());
    file_.ascii = line.starts_with("ASCII");
    if (!file_.ascii && !line.starts_with("BINARY"))
      return line_error(cursor_, quoted(line) + " is neither ASCII nor BINARY");
    return {};
  }

  bool next_words(WordList& words) {
    std::string_view line, word;
    words.clear();
    if (!cursor_.content_line(line, false)) return false;
    for (Words w(line); w.next(word);) words.emplace_back(word);
    return true;
  }

  Status section(const WordList& w) {
    const std::string& key = w[0];
    if (key == "DATASET") return data_set(w);
    if (key == "DIMENSIONS" || key == "LOOKUP_TABLE") return key == "DIMENSIONS" ? Status() : lookup_table(w);
    if (key == "POINTS") return points(w);
    if (key == "METADATA") return metadata();
    if (key == "CELL_TYPES") return skip_counted(w, 1, 1, ScalarType::i32);
    if (key == "CELLS" || key == "VERTICES" || key == "LINES" || key == "POLYGONS" ||
        key == "TRIANGLE_STRIPS")
      return cells(w);
    if (key == "POINT_DATA" || key == "CELL_DATA") return begin_data(w);
    if (key == "SCALARS") return scalars(w);
    if (key == "COLOR_SCALARS") return color_scalars(w);
    if (key == "VECTORS" || key == "NORMALS") return attribute(w, 3);
    if (key == "TENSORS") return attribute(w, 9);
    if (key == "TEXTURE_COORDINATES") return texture(w);
    if (key == "FIELD") return field(w);
    return line_error(cursor_, quoted(key) + " is no section of a VTK file that is read");
  }

  Error bad(const WordList& w, const std::string& what) { return line_error(cursor_, w[0] + ": " + what); }
  Result<std::uint64_t> number(const WordList& w, std::size_t i) {
    std::uint64_t v = 0;
    if (i >= w.size() || !parse_number(std::string_view(w[i]), v))
      return bad(w, "a count is missing or no whole number");
    return v;
  }
  Result<ScalarType> type(const WordList& w, std::size_t i) {
    const auto t = i < w.size() ? vtk_scalar(w[i]) : std::nullopt;
    if (!t) return bad(w, i < w.size() ? quoted(w[i]) + " is no type that is read" : "the type is missing");
    return *t;
  }

  Status data_set(const WordList& w) {
    const std::string kind = w.size() > 1 ? w[1] : "";
    if (kind == "POLYDATA" || kind == "UNSTRUCTURED_GRID" || kind == "STRUCTURED_GRID") return {};
    return make_error(ErrorCode::kUnsupported,
                      "is a VTK data set " + quoted(kind) +
                          "; POLYDATA, UNSTRUCTURED_GRID and STRUCTURED_GRID have points and are read");
  }

  Status points(const WordList& w) {
    if (file_.points != 0) return bad(w, "a second time");
    MAPCODEC_ASSIGN(file_.points, number(w, 1));
    MAPCODEC_ASSIGN(const ScalarType t, type(w, 2));
    if (file_.points == 0) return make_error(ErrorCode::kEmpty, "holds no point (VTK's POINTS announces 0)");
    return take_array("xyz", t, 3, file_.points, true);
  }

  Status cells(const WordList& w) {
    MAPCODEC_ASSIGN(const std::uint64_t first, number(w, 1));
    MAPCODEC_ASSIGN(const std::uint64_t second, number(w, 2));
    const std::uint64_t at = cursor_.offset(), lines = cursor_.line_number();
    WordList next;
    if (next_words(next) && next[0] == "OFFSETS") {  // VTK 5: two arrays with their own types
      MAPCODEC_ASSIGN(const ScalarType t, type(next, 1));
      MAPCODEC_TRY(skip_values(w[0], first, 1, t));
      if (!next_words(next) || next[0] != "CONNECTIVITY")
        return line_error(cursor_, "CONNECTIVITY is missing after OFFSETS");
      MAPCODEC_ASSIGN(const ScalarType u, type(next, 1));
      return skip_values(w[0], second, 1, u);
    }
    cursor_.seek(at, lines);
    return skip_values(w[0], second, 1, ScalarType::i32);
  }

  Status begin_data(const WordList& w) {
    MAPCODEC_ASSIGN(values_, number(w, 1));
    of_points_ = w[0] == "POINT_DATA";
    if (of_points_ && values_ != file_.points) {
      return bad(
          w, "has " + std::to_string(values_) + " values for " + std::to_string(file_.points) + " points");
    }
    return {};
  }

  Status scalars(const WordList& w) {
    MAPCODEC_ASSIGN(const ScalarType t, type(w, 2));
    std::uint64_t components = 1;
    if (w.size() > 3) {
      MAPCODEC_ASSIGN(components, number(w, 3));
    }
    const std::uint64_t at = cursor_.offset(), lines = cursor_.line_number();
    std::string_view line;
    // The table's name stands on a line of its own, which some writers leave out.
    if (!cursor_.content_line(line, false) || !line.starts_with("LOOKUP_TABLE")) cursor_.seek(at, lines);
    return take_array(w[1], t, components, values_, of_points_);
  }

  /// Colours: bytes in BINARY, numbers from 0 to 1 in ASCII.
  Status color_scalars(const WordList& w) {
    MAPCODEC_ASSIGN(const std::uint64_t components, number(w, 2));
    return take_array(w[1], file_.ascii ? ScalarType::f32 : ScalarType::u8, components, values_, of_points_);
  }
  Status attribute(const WordList& w, std::uint64_t components) {
    MAPCODEC_ASSIGN(const ScalarType t, type(w, 2));
    return take_array(w[0] == "NORMALS" ? "normal" : w[1], t, components, values_, of_points_);
  }
  Status texture(const WordList& w) {
    MAPCODEC_ASSIGN(const std::uint64_t components, number(w, 2));
    MAPCODEC_ASSIGN(const ScalarType t, type(w, 3));
    return take_array(w[1], t, components, values_, of_points_);
  }
  Status lookup_table(const WordList& w) {
    return skip_counted(w, 2, 4, file_.ascii ? ScalarType::f32 : ScalarType::u8);
  }

  Status field(const WordList& w) {
    MAPCODEC_ASSIGN(const std::uint64_t arrays, number(w, 2));
    for (std::uint64_t i = 0; i < arrays; ++i) {
      WordList a;
      if (!next_words(a)) return make_error(ErrorCode::kTruncated, "ends within a FIELD", cursor_.offset());
      if (a[0] == "METADATA") {
        MAPCODEC_TRY(metadata());
        --i;
        continue;
      }
      MAPCODEC_ASSIGN(const std::uint64_t components, number(a, 1));
      MAPCODEC_ASSIGN(const std::uint64_t tuples, number(a, 2));
      MAPCODEC_ASSIGN(const ScalarType t, type(a, 3));
      MAPCODEC_TRY(take_array(a[0], t, components, tuples, of_points_ && tuples == file_.points));
    }
    return {};
  }

  /// Lines up to a blank one.
  Status metadata() {
    std::string_view line;
    while (cursor_.line(line) && line.find_first_not_of(" \t") != std::string_view::npos) continue;
    return cursor_.status();
  }

  Status skip_counted(const WordList& w, std::size_t at, std::uint64_t components, ScalarType t) {
    MAPCODEC_ASSIGN(const std::uint64_t n, number(w, at));
    return skip_values(w[0], n, components, t);
  }

  /// Notes the array if it has a value per point, then passes it.
  Status take_array(const std::string& name, ScalarType t, std::uint64_t components, std::uint64_t tuples,
                    bool keep) {
    const bool fits = components >= 1 && components <= 255 && file_.arrays.size() < 250;
    if (keep && fits) {
      file_.arrays.push_back({{unique(name), t, static_cast<std::size_t>(components), file_.stride},
                              cursor_.offset(),
                              cursor_.line_number()});
      file_.stride += components * scalar_size(t);
    } else if (tuples > 0 && (keep || !of_points_)) {
      file_.warnings.push_back("the array " + quoted(name) + " is not kept");
    }
    return skip_values(name, tuples, components, t);
  }
  std::string unique(const std::string& name) const {
    std::string r = name;
    const auto same = [&](const VtkArray& a) { return a.field.name == r; };
    const auto taken = [&] {
      return r == "x" || r == "y" || r == "z" || std::any_of(file_.arrays.begin(), file_.arrays.end(), same);
    };
    for (int i = 2; taken(); ++i) r = name + "_" + std::to_string(i);
    return r;
  }

  Status skip_values(const std::string& what, std::uint64_t tuples, std::uint64_t components, ScalarType t) {
    // A value takes at least two bytes of text.
    const std::uint64_t least = components * (file_.ascii ? 2 : scalar_size(t));
    if (components > 0xFFFF || (least > 0 && tuples > (cursor_.left() + 1) / least)) {
      return make_error(ErrorCode::kTruncated,
                        quoted(what) + " announces " + std::to_string(tuples) + " x " +
                            std::to_string(components) + " values, but " + std::to_string(cursor_.left()) +
                            " bytes are left",
                        cursor_.offset());
    }
    if (file_.ascii) return skip_words(what, tuples * components);
    if (tuples * least > cursor_.left())
      return make_error(ErrorCode::kTruncated, quoted(what) + " ends too early", cursor_.offset());
    cursor_.skip(tuples * least);
    return {};
  }
  Status skip_words(const std::string& what, std::uint64_t count) {
    std::string_view line, word;
    for (std::uint64_t n = 0; n < count;) {
      if (!cursor_.content_line(line, false)) {
        return make_error(ErrorCode::kTruncated, quoted(what) + " announces " + std::to_string(count) +
                                                     " numbers, but ends after " + std::to_string(n));
      }
      for (Words w(line); w.next(word);) ++n;
      if (n > count)
        return line_error(cursor_, quoted(what) + " has more than its " + std::to_string(count) + " numbers");
    }
    return {};
  }

  Cursor& cursor_;
  VtkFile file_;
  std::uint64_t values_ = 0;
  bool of_points_ = false;
};

}  // namespace

std::optional<ScalarType> vtk_scalar(std::string_view word) {
  static const struct {
    const char* name;
    ScalarType scalar;
  } kTypes[] = {{"unsigned_char", ScalarType::u8},   {"char", ScalarType::i8},
                {"unsigned_short", ScalarType::u16}, {"short", ScalarType::i16},
                {"unsigned_int", ScalarType::u32},   {"int", ScalarType::i32},
                {"unsigned_long", ScalarType::u64},  {"long", ScalarType::i64},
                {"float", ScalarType::f32},          {"double", ScalarType::f64},
                {"vtktypeint64", ScalarType::i64},   {"vtktypeuint64", ScalarType::u64},
                {"vtkIdType", ScalarType::i32}};
  for (const auto& t : kTypes) {
    if (word == t.name) return t.scalar;
  }
  return std::nullopt;
}

Result<VtkFile> scan_vtk(Cursor& cursor) {
  return Scanner(cursor).run();
}

}  // namespace mapcodec
