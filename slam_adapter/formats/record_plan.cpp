// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/record_plan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;
using Fields = std::vector<RecordField>;

constexpr std::initializer_list<ScalarType> kFloats = {ScalarType::f32, ScalarType::f64};

const RecordField* find_field(const Fields& fields, std::string_view name) {
  const auto it =
      std::find_if(fields.begin(), fields.end(), [&](const RecordField& f) { return f.name == name; });
  return it == fields.end() ? nullptr : &*it;
}

/// The three fields called `names` if all are there with the same type out of `types`.
bool find_triple(const Fields& fields, const std::array<const char*, 3>& names,
                 std::initializer_list<ScalarType> types, std::array<const RecordField*, 3>& out) {
  for (std::size_t d = 0; d < 3; ++d) {
    out[d] = find_field(fields, names[d]);
    if (out[d] == nullptr || out[d]->components != 1 || out[d]->scalar != out[0]->scalar) return false;
  }
  return std::find(types.begin(), types.end(), out[0]->scalar) != types.end();
}

/// A name that no channel has yet: `name`, else name_2, ...
std::string unique_name(const PointCloud& layout, const std::string& name) {
  std::string r = name;
  for (int i = 2; layout.find(r) != nullptr; ++i) r = name + "_" + std::to_string(i);
  return r;
}

/// Builds a plan field by field; a field that went into a triple is marked used.
class Builder {
 public:
  Builder(const Fields& fields, RecordPlan& plan)
      : fields_(fields), plan_(plan), used_(fields.size(), false) {}

  Status axes() {
    const char* const names[3] = {"x", "y", "z"};
    bool all_f32 = true;
    for (std::size_t d = 0; d < 3; ++d) {
      const RecordField* f = find_field(fields_, names[d]);
      if (f == nullptr)
        return make_error(ErrorCode::kMalformed, std::string("the header names no field ") + names[d]);
      if (f->components != 1)
        return make_error(ErrorCode::kMalformed,
                          std::string("the field ") + names[d] + " has more than one component");
      plan_.axes[d] = {f->scalar, f->offset};
      all_f32 = all_f32 && f->scalar == ScalarType::f32;
      use(f);
    }
    plan_.layout.coordinates.kind = all_f32 ? Kind::f32 : Kind::f64;
    return {};
  }

  void channels(bool packed_rgb) {
    for (std::size_t i = 0; i < fields_.size(); ++i) {
      const RecordField& f = fields_[i];
      if (used_[i] || f.name == "_") continue;
      if (packed_rgb && is_packed(f)) {
        packed(f);
      } else if (!triple(f)) {
        plan_.add_channel({channel_name(f), f.scalar, static_cast<std::uint8_t>(f.components)}, f.offset);
      }
    }
  }

 private:
  void use(const RecordField* f) { used_[static_cast<std::size_t>(f - fields_.data())] = true; }

  static bool is_packed(const RecordField& f) {
    return (f.name == "rgb" || f.name == "rgba") && f.components == 1 && scalar_size(f.scalar) == 4;
  }
  /// b, g, r, a in memory order.
  void packed(const RecordField& f) {
    const std::size_t c = plan_.layout.channels.size();
    plan_.layout.channels.push_back({{unique_name(plan_.layout, "rgb"), ScalarType::u8, 3}, {}});
    plan_.layout.channels.push_back({{unique_name(plan_.layout, "alpha"), ScalarType::u8, 1}, {}});
    for (std::size_t d = 0; d < 3; ++d) plan_.moves.push_back({c, f.offset + 2 - d, d, 1, 0, 0xff});
    plan_.moves.push_back({c + 1, f.offset + 3, 0, 1, 0, 0xff});
  }

  bool triple(const RecordField& f) {
    return gather(f, {"red", "green", "blue"}, {ScalarType::u8, ScalarType::u16}, "rgb") ||
           gather(f, {"normal_x", "normal_y", "normal_z"}, kFloats, "normal") ||
           gather(f, {"nx", "ny", "nz"}, kFloats, "normal");
  }
  bool gather(const RecordField& first, const std::array<const char*, 3>& names,
              std::initializer_list<ScalarType> types, const char* name) {
    std::array<const RecordField*, 3> parts{};
    if (std::find(names.begin(), names.end(), first.name) == names.end()) return false;
    if (find_field(fields_, name) != nullptr || plan_.layout.find(name) != nullptr) return false;
    if (!find_triple(fields_, names, types, parts)) return false;
    const std::size_t size = scalar_size(first.scalar);
    const std::size_t c = plan_.layout.channels.size();
    plan_.layout.channels.push_back({{name, first.scalar, 3}, {}});
    for (std::size_t d = 0; d < 3; ++d) {
      plan_.moves.push_back({c, parts[d]->offset, d * size, size, 0, 0xff});
      use(parts[d]);
    }
    return true;
  }

  /// CloudCompare writes scalar_intensity for what everyone calls intensity.
  [[nodiscard]] std::string channel_name(const RecordField& f) const {
    const bool alias = f.name == "scalar_intensity" || f.name == "scalar_Intensity";
    const bool taken = find_field(fields_, "intensity") != nullptr;
    return unique_name(plan_.layout, alias && !taken ? "intensity" : f.name);
  }

  const Fields& fields_;
  RecordPlan& plan_;
  std::vector<bool> used_;
};

Status check_fields(const Fields& fields) {
  if (fields.size() > 255) {
    return make_error(ErrorCode::kUnsupported,
                      "has " + std::to_string(fields.size()) + " fields per point; at most 255 are read");
  }
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const RecordField& f = fields[i];
    if (f.name == "_") continue;
    if (f.components == 0 || f.components > 255) {
      return make_error(ErrorCode::kUnsupported, "field " + f.name + " has " + std::to_string(f.components) +
                                                     " components; 1 to 255 are read");
    }
    if (find_field(fields, f.name) != &f)
      return make_error(ErrorCode::kMalformed, "names the field " + f.name + " twice");
  }
  return {};
}

template <std::size_t kBytes>
void copy_column(const std::uint8_t* from, std::size_t from_stride, std::uint8_t* to, std::size_t to_stride,
                 std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) std::memcpy(to + i * to_stride, from + i * from_stride, kBytes);
}

void copy_column(const std::uint8_t* from, std::size_t from_stride, std::uint8_t* to, std::size_t to_stride,
                 std::size_t count, std::size_t bytes) {
  switch (bytes) {
    case 1:
      return copy_column<1>(from, from_stride, to, to_stride, count);
    case 2:
      return copy_column<2>(from, from_stride, to, to_stride, count);
    case 4:
      return copy_column<4>(from, from_stride, to, to_stride, count);
    case 8:
      return copy_column<8>(from, from_stride, to, to_stride, count);
    default:
      break;
  }
  for (std::size_t i = 0; i < count; ++i) std::memcpy(to + i * to_stride, from + i * from_stride, bytes);
}

template <class T>
void read_axis(const std::uint8_t* from, std::size_t stride, std::size_t d, std::vector<Vec3>& xyz) {
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    T v;
    std::memcpy(&v, from + i * stride, sizeof(T));
    xyz[i][d] = static_cast<double>(v);
  }
}

template <class T>
bool write_fixed(double units, std::uint8_t* to) {
  if (!(units >= double(std::numeric_limits<T>::min()) && units <= double(std::numeric_limits<T>::max())))
    return false;
  const auto v = static_cast<T>(units);
  std::memcpy(to, &v, sizeof(T));
  return true;
}

}  // namespace

Result<RecordPlan> RecordPlan::from_fields(const std::vector<RecordField>& fields, std::size_t stride,
                                           bool packed_rgb) {
  MAPCODEC_TRY(check_fields(fields));
  RecordPlan plan;
  plan.stride = stride;
  Builder builder(fields, plan);
  MAPCODEC_TRY(builder.axes());
  builder.channels(packed_rgb);
  return plan;
}

void RecordPlan::add_channel(ChannelInfo info, std::size_t offset) {
  moves.push_back({layout.channels.size(), offset, 0, info.stride(), 0, 0xff});
  layout.channels.push_back({std::move(info), {}});
}

void RecordPlan::add_bits(const std::string& name, std::size_t offset, unsigned shift, unsigned mask) {
  moves.push_back({layout.channels.size(), offset, 0, 1, shift, mask});
  layout.channels.push_back({{name, ScalarType::u8, 1}, {}});
}

std::size_t RecordPlan::rows_per_block() const {
  constexpr std::size_t kBudget = std::size_t{8} << 20;
  return std::clamp<std::size_t>(kBudget / std::max<std::size_t>(stride, 1), 1, 65536);
}

void RecordPlan::decode_xyz(const std::uint8_t* rows, std::size_t count, std::vector<Vec3>& xyz) const {
  xyz.resize(count);
  for (std::size_t d = 0; d < 3; ++d) {
    visit_scalar(axes[d].scalar,
                 [&](auto v) { read_axis<decltype(v)>(rows + axes[d].offset, stride, d, xyz); });
  }
  if (layout.coordinates.kind != Kind::fixed) return;
  for (Vec3& p : xyz) {
    for (std::size_t d = 0; d < 3; ++d)
      p[d] = p[d] * layout.coordinates.scale[d] + layout.coordinates.offset[d];
  }
}

void RecordPlan::decode(const std::uint8_t* rows, std::size_t count, PointCloud& block) const {
  block.resize(count);
  decode_xyz(rows, count, block.xyz);
  for (const Move& m : moves) {
    Channel& c = block.channels[m.channel];
    const std::size_t to_stride = c.info.stride();
    if (m.shift == 0 && m.mask == 0xff) {
      copy_column(rows + m.from, stride, c.data.data() + m.to, to_stride, count, m.bytes);
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        c.data[i * to_stride + m.to] =
            static_cast<std::uint8_t>((rows[i * stride + m.from] >> m.shift) & m.mask);
      }
    }
  }
}

bool RecordPlan::encode_xyz(const std::vector<Vec3>& xyz, std::uint8_t* rows) const {
  const CoordinateFormat& format = layout.coordinates;
  for (std::size_t i = 0; i < xyz.size(); ++i) {
    for (std::size_t d = 0; d < 3; ++d) {
      std::uint8_t* to = rows + i * stride + axes[d].offset;
      if (format.kind == Kind::fixed) {
        if (!write_fixed<std::int32_t>(std::round((xyz[i][d] - format.offset[d]) / format.scale[d]), to))
          return false;
      } else if (format.kind == Kind::f32) {
        const auto v = static_cast<float>(xyz[i][d]);
        std::memcpy(to, &v, sizeof(v));
      } else {
        std::memcpy(to, &xyz[i][d], sizeof(double));
      }
    }
  }
  return true;
}

bool RecordPlan::encode(const PointCloud& block, const std::vector<int>& sources, std::uint8_t* rows) const {
  const std::size_t count = block.size();
  std::fill_n(rows, count * stride, std::uint8_t{0});
  if (!encode_xyz(block.xyz, rows)) return false;
  for (const Move& m : moves) {
    if (sources[m.channel] < 0) continue;
    const Channel& c = block.channels[static_cast<std::size_t>(sources[m.channel])];
    const std::size_t from_stride = c.info.stride();
    if (m.shift == 0 && m.mask == 0xff) {
      copy_column(c.data.data() + m.to, from_stride, rows + m.from, stride, count, m.bytes);
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        const unsigned bits = (unsigned(c.data[i * from_stride + m.to]) & m.mask) << m.shift;
        rows[i * stride + m.from] = static_cast<std::uint8_t>(rows[i * stride + m.from] | bits);
      }
    }
  }
  return true;
}

std::vector<int> RecordPlan::match(const PointCloud& from) const {
  std::vector<int> r;
  for (const Channel& mine : layout.channels) {
    const auto it = std::find_if(from.channels.begin(), from.channels.end(),
                                 [&](const Channel& c) { return c.info == mine.info; });
    r.push_back(it == from.channels.end() ? -1 : static_cast<int>(it - from.channels.begin()));
  }
  return r;
}

}  // namespace mapcodec
