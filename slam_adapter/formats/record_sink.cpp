// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/record_sink.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "slam_adapter/formats/detect.hpp"

namespace mapcodec {
namespace {

using Kind = CoordinateFormat::Kind;

/// The channel of `plan` that holds `c` as another type, or null.
const ChannelInfo* other_type(const ChannelInfo& c, const PointCloud& plan) {
  const Channel* there = plan.find(c.name);
  const bool differs =
      there != nullptr && there->info.components == c.components && there->info.scalar != c.scalar;
  return differs ? &there->info : nullptr;
}

bool needs_conversion(const PointCloud& block, const PointCloud& plan) {
  return std::any_of(block.channels.begin(), block.channels.end(),
                     [&](const Channel& c) { return other_type(c.info, plan) != nullptr; });
}

/// Rounds to the nearest value that a T has; NaN becomes 0 where T has none.
template <class T>
T nearest(double v) {
  if constexpr (std::is_floating_point_v<T>) {
    return static_cast<T>(v);
  } else {
    if (!(v > double(std::numeric_limits<T>::min())))
      return std::isnan(v) ? T{0} : std::numeric_limits<T>::min();
    if (v >= double(std::numeric_limits<T>::max())) return std::numeric_limits<T>::max();
    return static_cast<T>(std::round(v));
  }
}

Channel convert(const Channel& from, const ChannelInfo& to) {
  Channel r{to, Bytes(from.size() * to.stride())};
  // 8-bit colour spreads over 16 bits: 255 -> 65535.
  const double factor =
      to.name == "rgb" && from.info.scalar == ScalarType::u8 && to.scalar == ScalarType::u16 ? 257 : 1;
  visit_scalar(from.info.scalar, [&](auto f) {
    visit_scalar(to.scalar, [&](auto t) {
      for (std::size_t i = 0; i < from.size() * to.components; ++i) {
        std::memcpy(&f, from.data.data() + i * sizeof(f), sizeof(f));
        t = nearest<decltype(t)>(static_cast<double>(f) * factor);
        std::memcpy(r.data.data() + i * sizeof(t), &t, sizeof(t));
      }
    });
  });
  return r;
}

PointCloud convert(const PointCloud& block, const PointCloud& plan) {
  PointCloud r = block;
  for (Channel& c : r.channels) {
    if (const ChannelInfo* to = other_type(c.info, plan)) c = convert(c, *to);
  }
  return r;
}

class RecordSink final : public PointSink {
 public:
  RecordSink(std::unique_ptr<RecordWriter> writer, std::uint64_t points)
      : writer_(std::move(writer)), announced_(points) {}

  Status open(const std::string& path) {
    MAPCODEC_TRY(file_.open(path));
    return writer_->begin(file_, announced_);
  }
  Status write(const PointCloud& block) override {
    if (!status_.ok() || block.empty()) return status_;
    status_ = write_block(block);
    return status_;
  }
  Status finish() override {
    if (!status_.ok()) return status_;
    if (written_ != announced_)
      return misuse(std::to_string(announced_) + " points were announced, but " + std::to_string(written_) +
                    " came");
    status_ = writer_->end(file_, written_);
    if (status_.ok()) status_ = file_.commit();
    return status_;
  }

 private:
  Status misuse(const std::string& what) {
    status_ = make_error(ErrorCode::kInvalidArgument, file_.path() + ": " + what);
    return status_;
  }
  Status write_block(const PointCloud& block) {
    const RecordPlan& plan = writer_->plan();
    if (block.size() > announced_ - written_)
      return misuse("more than the announced " + std::to_string(announced_) + " points came");
    if (written_ == 0) writer_->prepare(block);
    rows_.resize(block.size() * plan.stride);
    const PointCloud* from = &block;
    if (needs_conversion(block, plan.layout)) {
      converted_ = convert(block, plan.layout);
      from = &converted_;
    }
    if (!plan.encode(*from, plan.match(*from), rows_.data()))
      return misuse("a coordinate does not fit 32 bits of LAS's scale and offset");
    written_ += block.size();
    return writer_->write(file_, rows_.data(), block.size());
  }

  OutputFile file_;
  std::unique_ptr<RecordWriter> writer_;
  std::uint64_t announced_, written_ = 0;
  Bytes rows_;
  PointCloud converted_;
  Status status_;
};

Error unknown_extension(const std::string& path) {
  return make_error(
      ErrorCode::kInvalidArgument,
      path + ": no format is written by this extension; known are .pcd .ply .las .xyz .txt .pts .bin .vtk");
}

WriterChoice choose(const std::string& path, const PointCloud& layout, std::uint64_t points,
                    const WriteOptions& options) {
  const std::string extension = extension_of(path);
  if (extension == ".pcd") return make_pcd_writer(layout, options);
  if (extension == ".ply") return make_ply_writer(layout, options);
  if (extension == ".las") return make_las_writer(layout, points);
  if (extension == ".xyz" || extension == ".txt") return make_xyz_writer(layout);
  if (extension == ".pts") return make_pts_writer(layout);
  if (extension == ".bin") return make_kitti_writer(layout);
  if (extension == ".vtk") return make_vtk_writer(layout);
  return {};
}

Status check_options(const std::string& path, std::uint64_t points, const WriteOptions& o) {
  const std::string extension = extension_of(path);
  const auto refuse = [&](const char* what) {
    return make_error(ErrorCode::kInvalidArgument, path + ": " + what);
  };
  const bool text = extension == ".xyz" || extension == ".txt" || extension == ".pts";
  if (o.ascii && o.compressed) return refuse("text cannot be compressed");
  if (o.compressed && extension != ".pcd") return refuse("only PCD has a compressed form");
  if (o.ascii && extension != ".pcd" && extension != ".ply" && !text)
    return refuse("this format is written in binary only");
  if (extension == ".vtk" && points > 0x3FFFFFFF)
    return refuse("VTK's 32-bit cells hold at most 1,073,741,823 points");
  return {};
}

}  // namespace

WriteFields::WriteFields(const PointCloud& layout) {
  const bool narrow = layout.coordinates.kind == Kind::f32;
  plan.layout.coordinates.kind = narrow ? Kind::f32 : Kind::f64;
  for (std::size_t d = 0; d < 3; ++d) {
    plan.axes[d] = {narrow ? ScalarType::f32 : ScalarType::f64, plan.stride};
    append(std::string(1, "xyz"[d]), plan.axes[d].scalar, 1);
  }
}

bool WriteFields::available(const std::string& name) const {
  const bool printable =
      std::none_of(name.begin(), name.end(), [](char c) { return (c >= 0 && c <= ' ') || c == 127; });
  const auto same = [&](const RecordField& f) { return f.name == name; };
  return !name.empty() && printable && name != "_" && fields.size() < 255 &&
         std::none_of(fields.begin(), fields.end(), same);
}

void WriteFields::append(const std::string& name, ScalarType scalar, std::size_t components) {
  fields.push_back({name, scalar, components, plan.stride});
  plan.stride += scalar_size(scalar) * components;
}

bool WriteFields::add(const ChannelInfo& info, const std::string& name) {
  if (!available(name)) return false;
  plan.add_channel(info, plan.stride);
  append(name, info.scalar, info.components);
  return true;
}

bool WriteFields::split(const ChannelInfo& info, const std::vector<std::string>& names) {
  for (const std::string& n : names) {
    if (!available(n)) return false;
  }
  plan.add_channel(info, plan.stride);
  for (const std::string& n : names) append(n, info.scalar, 1);
  return true;
}

bool WriteFields::add_packed_rgb(const PointCloud& layout, const char* name, ScalarType scalar) {
  if (!available(name)) return false;
  const std::size_t c = plan.layout.channels.size(), at = plan.stride;
  plan.layout.channels.push_back({{"rgb", ScalarType::u8, 3}, {}});
  for (std::size_t d = 0; d < 3; ++d) plan.moves.push_back({c, at + 2 - d, d, 1, 0, 0xff});
  const Channel* alpha = layout.find("alpha");
  if (alpha != nullptr && is_channel(alpha->info, "alpha", 1, {ScalarType::u8})) {
    plan.layout.channels.push_back({alpha->info, {}});
    plan.moves.push_back({c + 1, at + 3, 0, 1, 0, 0xff});
  }
  append(name, scalar, 1);
  return true;
}

void WriteFields::add_zeros(const std::string& name, ScalarType scalar) {
  append(name, scalar, 1);
}

void note_losses(const PointCloud& layout, const RecordPlan& plan, std::vector<std::string>& losses) {
  for (const Channel& c : layout.channels) {
    const Channel* there = plan.layout.find(c.info.name);
    if (there == nullptr || there->info.components != c.info.components)
      losses.push_back(loss(c.info));
    else if (there->info.scalar != c.info.scalar)
      losses.push_back("the channel " + c.info.name + " is converted from " + scalar_name(c.info.scalar) +
                       " to " + scalar_name(there->info.scalar));
  }
}

std::vector<std::string> numbered_names(const ChannelInfo& c) {
  std::vector<std::string> r;
  for (int i = 0; i < c.components; ++i) r.push_back(c.name + "_" + std::to_string(i));
  return r;
}

bool is_taken_apart(const ChannelInfo& c) {
  return c.components > 1 && !is_channel(c, "rgb", 3, {ScalarType::u8, ScalarType::u16}) && !is_normals(c);
}

std::string taken_apart(const ChannelInfo& c) {
  return "the channel " + c.name + " (" + c.type_name() + ") is written as " + c.name + "_0, " + c.name +
         "_1, ...";
}

std::string loss(const ChannelInfo& info) {
  return "the channel " + info.name + " (" + info.type_name() + ") is not written";
}

bool is_channel(const ChannelInfo& info, const char* name, std::size_t components,
                std::initializer_list<ScalarType> types) {
  return info.name == name && info.components == components &&
         std::find(types.begin(), types.end(), info.scalar) != types.end();
}

Result<std::unique_ptr<PointSink>> open_sink(const std::string& path, const PointCloud& layout,
                                             std::uint64_t points, const WriteOptions& options) {
  WriterChoice choice = choose(path, layout, points, options);
  if (!choice.writer) return unknown_extension(path);
  MAPCODEC_TRY(check_options(path, points, options));
  auto sink = std::make_unique<RecordSink>(std::move(choice.writer), points);
  MAPCODEC_TRY(sink->open(path));
  return std::unique_ptr<PointSink>(std::move(sink));
}

std::vector<std::string> unwritten_channels(const std::string& path, const PointCloud& layout) {
  return choose(path, layout, 0, {}).losses;
}

}  // namespace mapcodec
