// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/e57/e57_columns.hpp"

#include <algorithm>
#include <limits>

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

const std::vector<std::string> kCartesian{"cartesianX", "cartesianY", "cartesianZ"};
const std::vector<std::string> kSpherical{"sphericalRange", "sphericalAzimuth", "sphericalElevation"};

/// What the fields of E57 are called here; others keep their names.
std::string channel_name(const std::string& field) {
  static const struct {
    const char *e57, *ours;
  } kNames[] = {{"colorRed", "red"},
                {"colorGreen", "green"},
                {"colorBlue", "blue"},
                {"timeStamp", "time"},
                {"rowIndex", "row"},
                {"columnIndex", "column"},
                {"returnIndex", "return_number"},
                {"returnCount", "number_of_returns"},
                {"isIntensityInvalid", "intensity_invalid"},
                {"isColorInvalid", "color_invalid"},
                {"isTimeStampInvalid", "time_invalid"},
                {"nor:normalX", "normal_x"},
                {"nor:normalY", "normal_y"},
                {"nor:normalZ", "normal_z"}};
  for (const auto& n : kNames) {
    if (field == n.e57) return n.ours;
  }
  return field;
}

bool is_consumed(const std::string& field) {
  const auto in = [&](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), field) != names.end();
  };
  return in(kCartesian) || in(kSpherical) || field == "cartesianInvalidState" ||
         field == "sphericalInvalidState";
}

template <class T>
bool fits(std::int64_t min, std::int64_t max) {
  return min >= std::int64_t{std::numeric_limits<T>::min()} &&
         max <= std::int64_t{std::numeric_limits<T>::max()};
}

ScalarType integer_type(std::int64_t min, std::int64_t max) {
  if (fits<std::uint8_t>(min, max)) return ScalarType::u8;
  if (fits<std::int8_t>(min, max)) return ScalarType::i8;
  if (fits<std::uint16_t>(min, max)) return ScalarType::u16;
  if (fits<std::int16_t>(min, max)) return ScalarType::i16;
  if (fits<std::uint32_t>(min, max)) return ScalarType::u32;
  if (fits<std::int32_t>(min, max)) return ScalarType::i32;
  return ScalarType::i64;
}

/// The type that holds what all scans store for `field`; false if one has none, or text.
bool common_type(const E57Description& d, const std::string& field, ScalarType& type) {
  bool all_integers = true, all_f32 = true;
  std::int64_t min = std::numeric_limits<std::int64_t>::max(), max = std::numeric_limits<std::int64_t>::min();
  for (const E57Scan& scan : d.scans) {
    const E57Field* f = scan.find(field);
    if (f == nullptr || f->kind == E57Field::Kind::text) return false;
    all_f32 = all_f32 && f->kind == E57Field::Kind::f32;
    all_integers = all_integers && f->kind == E57Field::Kind::integer;
    min = std::min(min, f->min);
    max = std::max(max, f->max);
  }
  type = all_integers ? integer_type(min, max) : all_f32 ? ScalarType::f32 : ScalarType::f64;
  return true;
}

/// One scan, not moved, whose coordinates have a format that can stay.
CoordinateFormat coordinates_of(const E57Description& d) {
  const CoordinateFormat f64{Kind::f64, {1, 1, 1}, {0, 0, 0}};
  const E57Scan& scan = d.scans.front();
  if (d.scans.size() > 1 || scan.moved || scan.find("cartesianX") == nullptr) return f64;
  CoordinateFormat fixed{Kind::fixed, {1, 1, 1}, {0, 0, 0}};
  bool all_f32 = true, all_fixed = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const E57Field& f = *scan.find(kCartesian[i]);
    all_f32 = all_f32 && f.kind == E57Field::Kind::f32;
    all_fixed =
        all_fixed && f.kind == E57Field::Kind::scaled && fits<std::int32_t>(f.min, f.max) && f.scale > 0;
    fixed.scale[i] = f.scale;
    fixed.offset[i] = f.offset;
  }
  return all_f32 ? CoordinateFormat{} : all_fixed ? fixed : f64;
}

Status check(const E57Description& d) {
  for (const E57Scan& scan : d.scans) {
    const std::vector<std::string> names = coordinate_fields(scan);
    if (names.empty()) return make_error(ErrorCode::kMalformed, "has a scan without coordinates");
    for (const std::string& name : names) {
      if (scan.find(name)->kind == E57Field::Kind::text)
        return make_error(ErrorCode::kMalformed, "has a scan whose coordinates are text");
    }
  }
  return {};
}

}  // namespace

std::vector<std::string> coordinate_fields(const E57Scan& scan) {
  for (const auto* names : {&kCartesian, &kSpherical}) {
    if (std::all_of(names->begin(), names->end(),
                    [&](const std::string& n) { return scan.find(n) != nullptr; }))
      return *names;
  }
  return {};
}

Result<E57Columns> E57Columns::choose(const E57Description& d) {
  MAPCODEC_TRY(check(d));
  E57Columns r;
  const CoordinateFormat coordinates = coordinates_of(d);
  const ScalarType axis = coordinates.kind == Kind::f32     ? ScalarType::f32
                          : coordinates.kind == Kind::fixed ? ScalarType::i32
                                                            : ScalarType::f64;
  std::vector<RecordField> fields;
  std::size_t at = 0;
  const auto add = [&](const std::string& name, ScalarType type) {
    fields.push_back({name, type, 1, at});
    at += scalar_size(type);
  };
  for (const char* name : {"x", "y", "z"}) add(name, axis);
  for (const E57Scan& scan : d.scans) {
    for (const E57Field& f : scan.fields) {
      ScalarType type = ScalarType::f64;
      const auto same = [&](const Column& c) { return c.field == f.name; };
      if (is_consumed(f.name) || std::any_of(r.columns.begin(), r.columns.end(), same)) continue;
      if (!common_type(d, f.name, type)) {
        const std::string warning =
            "the field " + f.name + " is not kept, since not all scans have it as a number";
        if (std::find(r.warnings.begin(), r.warnings.end(), warning) == r.warnings.end())
          r.warnings.push_back(warning);
        continue;
      }
      add(channel_name(f.name), type);
      r.columns.push_back({f.name, fields.back()});
    }
  }
  MAPCODEC_ASSIGN(r.plan, RecordPlan::from_fields(fields, at, false));
  r.plan.layout.coordinates = coordinates;
  if (d.images > 0) r.warnings.push_back(std::to_string(d.images) + " images are not kept");
  return r;
}

}  // namespace mapcodec
