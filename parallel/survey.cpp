// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/survey.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "parallel/guard.hpp"
#include "parallel/memory_share.hpp"
#include "parallel/ordered_pipeline.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kMaxSample = 200000;
constexpr std::size_t kExtentSample = 1024;
constexpr int kCellsAcrossLog2 = 7;
constexpr double kOriginStep = 1024;

/// What all slots start from, taken from the first points.
struct Start {
  Vec3 origin{0, 0, 0};
  int exponent = 0;
};

/// Enough cells to cut tiles of any sensible size, few enough to stay in a core's cache while points are
/// counted.
std::size_t max_cells(std::uint64_t announced) {
  constexpr std::uint64_t kPointsPerCell = 64, kLeast = std::uint64_t{1} << 15,
                          kUnknown = std::uint64_t{1} << 16;
  if (announced == 0) return kUnknown;
  return std::clamp<std::uint64_t>(announced / kPointsPerCell, kLeast, VoxelHistogram::kMaxCells);
}

/// One block on its way, and what was found in all blocks that passed through this slot.
struct Slot {
  PointCloud block;
  Box bounds;
  std::uint64_t nonfinite = 0;
  std::optional<VoxelHistogram> histogram;
  std::vector<bool> varies;
};

/// Extent of the middle 80 % of some of `points`, largest axis: a stray point must not set the first cell.
double typical_extent(const std::vector<Vec3>& points) {
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kExtentSample);
  double extent = 0;
  for (std::size_t d = 0; d < 3; ++d) {
    std::vector<double> v;
    for (std::size_t i = 0; i < points.size(); i += stride) {
      if (has_place(points[i])) v.push_back(points[i][d]);
    }
    if (v.empty()) return 0;
    std::sort(v.begin(), v.end());
    extent = std::max(extent, v[v.size() * 9 / 10] - v[v.size() / 10]);
  }
  return extent;
}

std::optional<Start> find_start(const std::vector<Vec3>& points) {
  const auto first = std::find_if(points.begin(), points.end(), has_place);
  if (first == points.end()) return std::nullopt;
  Start s;
  for (std::size_t d = 0; d < 3; ++d) s.origin[d] = std::floor((*first)[d] / kOriginStep + 0.5) * kOriginStep;
  const double extent = typical_extent(points);
  const int log2_extent = extent > 0 ? std::ilogb(extent) : VoxelHistogram::kMinExponent;
  s.exponent = std::max(VoxelHistogram::kMinExponent, log2_extent - kCellsAcrossLog2);
  return s;
}

bool all_equal(const Channel& c, const Bytes& value) {
  const std::size_t stride = c.info.stride();
  if (c.data.size() < stride || stride == 0) return true;
  return std::memcmp(c.data.data(), value.data(), stride) == 0 &&
         std::memcmp(c.data.data(), c.data.data() + stride, c.data.size() - stride) == 0;
}

class SurveyPass {
 public:
  SurveyPass(PointSource& source, const SurveySettings& settings) : source_(source), settings_(settings) {
    result_.layout = source.layout().like();
    announced_ = source.announced_points().value_or(0);
    slots_.resize(settings.arena != nullptr ? static_cast<std::size_t>(settings.arena->threads()) + 1 : 1);
    for (Slot& s : slots_) s.varies.assign(result_.layout.channels.size(), false);
    open_cloud();
  }

  Result<Survey> run() {
    const OrderedStages stages{[this](std::size_t s) { return read(slots_[s]); },
                               [this](std::size_t s) { return analyse(slots_[s]); },
                               [this](std::size_t s) { return collect(slots_[s].block); }};
    MAPCODEC_TRY(run_ordered(settings_.arena, slots_.size(), stages, settings_.stop, "survey"));
    if (result_.points == 0) return make_error(ErrorCode::kEmpty, "the source holds no point");
    finish();
    return std::move(result_);
  }

 private:
  void open_cloud();
  Result<bool> read(Slot& slot);
  Status analyse(Slot& slot) const;
  Status collect(const PointCloud& block);
  void take_sample(const std::vector<Vec3>& points);
  void keep(const PointCloud& block);
  void finish();

  PointSource& source_;
  const SurveySettings& settings_;
  std::uint64_t announced_ = 0;
  std::uint64_t max_kept_ = 0;
  std::uint64_t sample_stride_ = 1;
  std::optional<Start> start_;
  std::vector<Bytes> first_values_;
  std::vector<Slot> slots_;
  Survey result_;
};

void SurveyPass::open_cloud() {
  const std::uint64_t fit = points_kept_in_memory(result_.layout, settings_.memory_budget_bytes);
  // An array that grows is there twice while it is copied, so less fits if nobody announced how many will
  // come.
  max_kept_ = announced_ > 0 && announced_ <= fit ? fit : fit / 3;
  if (max_kept_ == 0 || announced_ > max_kept_) return;
  result_.cloud = result_.layout;
  result_.cloud->xyz.reserve(announced_);
  for (Channel& c : result_.cloud->channels) c.data.reserve(announced_ * c.info.stride());
}

Result<bool> SurveyPass::read(Slot& slot) {
  MAPCODEC_ASSIGN(const bool more, source_.next(slot.block));
  if (!more || slot.block.empty()) return more;
  if (!start_) start_ = find_start(slot.block.xyz);
  if (start_ && !slot.histogram) {
    slot.histogram.emplace(start_->origin, start_->exponent, max_cells(announced_));
  }
  if (first_values_.empty()) {
    for (const Channel& c : slot.block.channels) first_values_.emplace_back(c.at(0), c.at(1));
  }
  return true;
}

Status SurveyPass::analyse(Slot& slot) const {
  for (const Vec3& p : slot.block.xyz) {
    if (!has_place(p)) {
      ++slot.nonfinite;
      continue;
    }
    slot.bounds.add(p);
    slot.histogram->add(p);
  }
  for (std::size_t c = 0; c < slot.block.channels.size(); ++c) {
    if (!slot.varies[c]) slot.varies[c] = !all_equal(slot.block.channels[c], first_values_[c]);
  }
  return {};
}

Status SurveyPass::collect(const PointCloud& block) {
  take_sample(block.xyz);
  if (result_.cloud) keep(block);
  result_.points += block.size();
  if (settings_.progress) settings_.progress({"survey", result_.points, announced_, 0});
  return {};
}

void SurveyPass::take_sample(const std::vector<Vec3>& points) {
  const std::uint64_t behind = result_.points % sample_stride_;
  for (std::size_t i = behind == 0 ? 0 : sample_stride_ - behind; i < points.size(); i += sample_stride_) {
    result_.sample.push_back(points[i]);
  }
  while (result_.sample.size() > kMaxSample) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < result_.sample.size(); i += 2) result_.sample[kept++] = result_.sample[i];
    result_.sample.resize(kept);
    sample_stride_ *= 2;
  }
}

void SurveyPass::keep(const PointCloud& block) {
  if (result_.points + block.size() > max_kept_) {
    result_.cloud.reset();
  } else {
    result_.cloud->append(block);
  }
}

void SurveyPass::finish() {
  std::vector<bool> varies(result_.layout.channels.size(), false);
  bool first = true;
  for (Slot& s : slots_) {
    result_.bounds.add(s.bounds);
    result_.nonfinite += s.nonfinite;
    for (std::size_t c = 0; c < varies.size(); ++c) varies[c] = varies[c] || s.varies[c];
    if (!s.histogram) continue;
    if (first) {
      result_.histogram = std::move(*s.histogram);
    } else {
      result_.histogram.merge(*s.histogram);
    }
    first = false;
    s.histogram.reset();
  }
  for (std::size_t c = 0; c < varies.size(); ++c) {
    result_.constant_channels.push_back(varies[c] ? std::nullopt : std::optional<Bytes>(first_values_[c]));
  }
  std::erase_if(result_.sample, [](const Vec3& p) { return !has_place(p); });
  result_.dropped = source_.dropped_points();
  result_.warnings = source_.warnings();
  if (result_.nonfinite > 0) {
    result_.warnings.push_back(std::to_string(result_.nonfinite) + " points have no usable position");
  }
}

}  // namespace

Result<Survey> survey(PointSource& source, const SurveySettings& settings) {
  return parallel_detail::guarded("survey", [&] { return SurveyPass(source, settings).run(); });
}

}  // namespace mapcodec
