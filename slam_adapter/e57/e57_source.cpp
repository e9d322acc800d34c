// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cmath>

#include "slam_adapter/e57/e57.hpp"
#include "slam_adapter/e57/e57_columns.hpp"
#include "slam_adapter/e57/e57_packets.hpp"
#include "slam_adapter/e57/e57_pages.hpp"

namespace mapcodec {
namespace {

using Kind = E57Field::Kind;

std::int64_t integer_of(const E57Field& f, std::uint64_t raw) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(f.min) + raw);
}

double value_of(const E57Field& f, std::uint64_t raw) {
  switch (f.kind) {
    case Kind::f32:
      return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
    case Kind::f64:
      return std::bit_cast<double>(raw);
    case Kind::scaled:
      return static_cast<double>(integer_of(f, raw)) * f.scale + f.offset;
    default:
      return static_cast<double>(integer_of(f, raw));
  }
}

/// Writes the value of `f` as `to.scalar`, which holds all that the field may be.
void store(const E57Field& f, std::uint64_t raw, const RecordField& to, std::uint8_t* row) {
  visit_scalar(to.scalar, [&](auto zero) {
    using T = decltype(zero);
    T v;
    if constexpr (std::is_floating_point_v<T>) {
      v = static_cast<T>(value_of(f, raw));
      // Through double, a NaN would lose its payload.
      if (sizeof(T) == 4 && f.kind == Kind::f32) std::memcpy(&v, &raw, sizeof(T));
    } else {
      v = static_cast<T>(integer_of(f, raw));
    }
    std::memcpy(row + to.offset, &v, sizeof(T));
  });
}

/// How the fields of one scan go into records.
struct ScanPlan {
  std::vector<std::size_t> coordinates;  ///< fields, three
  bool spherical = false;
  std::vector<std::size_t> columns;    ///< fields, in the order of E57Columns
  std::optional<std::size_t> invalid;  ///< field of the state that says whether it is a point
  std::array<Vec3, 3> rotation{};
};

std::size_t index_of(const E57Scan& scan, const std::string& field) {
  return static_cast<std::size_t>(scan.find(field) - scan.fields.data());
}

std::array<Vec3, 3> rotation_of(const std::array<double, 4>& wxyz) {
  const auto [w, x, y, z] = wxyz;
  return {Vec3{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
          Vec3{2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
          Vec3{2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
}

ScanPlan plan_scan(const E57Scan& scan, const E57Columns& columns) {
  ScanPlan p;
  const std::vector<std::string> names = coordinate_fields(scan);
  for (const std::string& name : names) p.coordinates.push_back(index_of(scan, name));
  p.spherical = names.front() == "sphericalRange";
  for (const auto& c : columns.columns) p.columns.push_back(index_of(scan, c.field));
  const char* state = p.spherical ? "sphericalInvalidState" : "cartesianInvalidState";
  const E57Field* invalid = scan.find(state);
  if (invalid != nullptr && invalid->kind == Kind::integer) p.invalid = index_of(scan, state);
  p.rotation = rotation_of(scan.rotation_wxyz);
  return p;
}

class E57Reader final : public RecordReader {
 public:
  E57Reader(std::unique_ptr<E57Pages> pages, E57Description description, E57Columns columns)
      : pages_(std::move(pages)), description_(std::move(description)), columns_(std::move(columns)) {}

  [[nodiscard]] const RecordPlan& plan() const override { return columns_.plan; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override {
    std::uint64_t sum = 0;
    for (const E57Scan& s : description_.scans) sum += s.records;
    return sum;
  }
  [[nodiscard]] std::uint64_t skipped() const override { return skipped_; }
  [[nodiscard]] std::vector<std::string> warnings() const override { return columns_.warnings; }
  void rewind() override {
    at_ = 0;
    left_ = 0;
    skipped_ = 0;
    packets_.reset();
  }

  Result<std::size_t> read(std::uint8_t* rows, std::size_t max) override {
    std::size_t n = 0;
    while (n < max) {
      if (left_ == 0) {
        if (at_ == description_.scans.size()) break;
        MAPCODEC_TRY(open_scan());
      }
      MAPCODEC_TRY(packets_->prepare());
      --left_;
      n += record(rows + n * columns_.plan.stride) ? 1 : 0;
    }
    return n;
  }

 private:
  Status open_scan() {
    const E57Scan& scan = description_.scans[at_++];
    packets_.emplace(*pages_, scan);
    MAPCODEC_TRY(packets_->open());
    plan_ = plan_scan(scan, columns_);
    raw_.resize(scan.fields.size());
    left_ = scan.records;
    return {};
  }

  /// False for a record that is no point.
  bool record(std::uint8_t* row) {
    const E57Scan& scan = description_.scans[at_ - 1];
    for (std::size_t f = 0; f < raw_.size(); ++f) raw_[f] = packets_->take(f);
    if (plan_.invalid && integer_of(scan.fields[*plan_.invalid], raw_[*plan_.invalid]) != 0) {
      ++skipped_;
      return false;
    }
    coordinates(scan, row);
    for (std::size_t c = 0; c < plan_.columns.size(); ++c)
      store(scan.fields[plan_.columns[c]], raw_[plan_.columns[c]], columns_.columns[c].record, row);
    return true;
  }

  void coordinates(const E57Scan& scan, std::uint8_t* row) const {
    const RecordPlan& plan = columns_.plan;
    if (plan.layout.coordinates.kind != CoordinateFormat::Kind::f64) {
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t f = plan_.coordinates[d];
        if (plan.axes[d].scalar == ScalarType::f32)
          std::memcpy(row + plan.axes[d].offset, &raw_[f], 4);
        else
          store({"", Kind::integer, scan.fields[f].min, scan.fields[f].max, 1, 0}, raw_[f],
                {"", ScalarType::i32, 1, plan.axes[d].offset}, row);
      }
      return;
    }
    Vec3 p;
    for (std::size_t d = 0; d < 3; ++d)
      p[d] = value_of(scan.fields[plan_.coordinates[d]], raw_[plan_.coordinates[d]]);
    if (plan_.spherical) {
      const auto [range, azimuth, elevation] = p;
      const double flat = range * std::cos(elevation);
      p = {flat * std::cos(azimuth), flat * std::sin(azimuth), range * std::sin(elevation)};
    }
    if (scan.moved) p = moved(p, scan);
    for (std::size_t d = 0; d < 3; ++d) std::memcpy(row + plan.axes[d].offset, &p[d], 8);
  }

  [[nodiscard]] Vec3 moved(const Vec3& p, const E57Scan& scan) const {
    Vec3 r = scan.translation_m;
    for (std::size_t d = 0; d < 3; ++d) {
      const Vec3& m = plan_.rotation[d];
      r[d] += m[0] * p[0] + m[1] * p[1] + m[2] * p[2];
    }
    return r;
  }

  std::unique_ptr<E57Pages> pages_;
  E57Description description_;
  E57Columns columns_;
  std::size_t at_ = 0;
  std::uint64_t left_ = 0, skipped_ = 0;
  std::optional<E57Packets> packets_;
  ScanPlan plan_;
  std::vector<std::uint64_t> raw_;
};

/// Records without a bit could be announced without end.
Status check_sizes(const E57Description& d, std::uint64_t bytes) {
  for (const E57Scan& scan : d.scans) {
    std::uint64_t bits = 0;
    for (const E57Field& f : scan.fields) bits += f.bits();
    if (scan.records > 1 && (bits == 0 || scan.records > bytes * 8 / bits)) {
      return make_error(ErrorCode::kTruncated, "announces " + std::to_string(scan.records) + " points of " +
                                                   std::to_string(bits) + " bits in " +
                                                   std::to_string(bytes) + " bytes");
    }
  }
  return {};
}

}  // namespace

ReaderResult open_e57(const ByteStream& stream) {
  auto pages = std::make_unique<E57Pages>(stream);
  MAPCODEC_ASSIGN(E57Description description, read_e57_description(stream, *pages));
  MAPCODEC_TRY(check_sizes(description, stream.size()));
  MAPCODEC_ASSIGN(E57Columns columns, E57Columns::choose(description));
  return std::unique_ptr<RecordReader>(
      std::make_unique<E57Reader>(std::move(pages), std::move(description), std::move(columns)));
}

}  // namespace mapcodec
