// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <optional>

#include "slam_adapter/formats/record_source.hpp"

namespace mapcodec {
namespace {

using Sources = std::vector<std::unique_ptr<PointSource>>;

class Concatenation final : public PointSource {
 public:
  Concatenation(Sources sources, PointCloud layout, std::vector<std::string> warnings)
      : sources_(std::move(sources)), layout_(std::move(layout)), warnings_(std::move(warnings)) {}

  [[nodiscard]] const PointCloud& layout() const override { return layout_; }
  [[nodiscard]] std::optional<std::uint64_t> announced_points() const override {
    std::uint64_t sum = 0;
    for (const auto& s : sources_) {
      const auto n = s->announced_points();
      if (!n) return std::nullopt;
      sum += *n;
    }
    return sum;
  }
  Result<bool> next(PointCloud& block) override {
    for (; at_ < sources_.size(); ++at_) {
      auto more = sources_[at_]->next(part_);
      if (!more.ok()) block = layout_;
      if (!more.ok()) return more;
      if (*more) break;
    }
    if (at_ == sources_.size()) part_ = sources_.back()->layout();
    arrange(block);
    return !block.empty();
  }
  Status rewind() override {
    for (const auto& s : sources_) MAPCODEC_TRY(s->rewind());
    at_ = 0;
    return {};
  }
  [[nodiscard]] std::uint64_t dropped_points() const override {
    std::uint64_t sum = 0;
    for (const auto& s : sources_) sum += s->dropped_points();
    return sum;
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    std::vector<std::string> r = warnings_;
    for (const auto& s : sources_) {
      for (std::string& w : s->warnings()) r.push_back(std::move(w));
    }
    return r;
  }

 private:
  /// Moves part_ into `block`, channels in the common order.
  void arrange(PointCloud& block) {
    block = layout_;
    block.xyz.swap(part_.xyz);
    for (Channel& c : block.channels) c.data.swap(part_.find(c.info.name)->data);
  }

  Sources sources_;
  PointCloud layout_, part_;
  std::vector<std::string> warnings_;  // of putting them together
  std::size_t at_ = 0;
};

std::string name_of(const Sources& sources, std::size_t i) {
  const auto* source = dynamic_cast<const NamedSource*>(sources[i].get());
  return source != nullptr ? source->name() : "input " + std::to_string(i + 1);
}

Error missing(const Sources& sources, std::size_t without, std::size_t with, const ChannelInfo& c) {
  return make_error(ErrorCode::kInvalidArgument, name_of(sources, without) + ": has no channel " + c.name +
                                                     " (" + c.type_name() + "), which " +
                                                     name_of(sources, with) +
                                                     " has; inputs of one map need the same channels");
}

bool has(const PointCloud& layout, const ChannelInfo& c) {
  const Channel* found = layout.find(c.name);
  return found != nullptr && found->info == c;
}

bool is_alpha(const ChannelInfo& c) {
  return c.name == "alpha";
}

/// The channels of source i are those of `common`, but for an alpha that `common` lacks unless
/// `every_channel`.
Status check_channels(const Sources& sources, std::size_t i, const PointCloud& common, bool every_channel) {
  const PointCloud& other = sources[i]->layout();
  for (const Channel& c : common.channels) {
    if (!has(other, c.info)) return missing(sources, i, 0, c.info);
  }
  for (const Channel& c : other.channels) {
    const bool left_out = !every_channel && is_alpha(c.info) && common.find("alpha") == nullptr;
    if (!left_out && !has(common, c.info)) return missing(sources, 0, i, c.info);
  }
  return {};
}

/// Takes alpha, which PCD's packed colour always brings and other formats seldom, out of `common` if a source
/// has none. What is then lost is said in `warnings`.
void drop_partial_alpha(const Sources& sources, PointCloud& common, std::vector<std::string>& warnings) {
  std::optional<std::size_t> with, without;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    auto& place = sources[i]->layout().find("alpha") != nullptr ? with : without;
    if (!place) place = i;
  }
  if (!with || !without) return;
  std::erase_if(common.channels, [](const Channel& c) { return is_alpha(c.info); });
  warnings.push_back(name_of(sources, *with) + ": the fourth byte of its colour (alpha) is not kept, since " +
                     name_of(sources, *without) + " has none");
}

}  // namespace

Result<std::unique_ptr<PointSource>> concatenate(Sources sources, bool every_channel) {
  if (sources.empty()) return make_error(ErrorCode::kInvalidArgument, "no input is given");
  if (sources.size() == 1) return std::move(sources.front());
  PointCloud layout = sources.front()->layout();
  std::vector<std::string> warnings;
  if (!every_channel) drop_partial_alpha(sources, layout, warnings);
  for (std::size_t i = 1; i < sources.size(); ++i) {
    MAPCODEC_TRY(check_channels(sources, i, layout, every_channel));
    if (sources[i]->layout().coordinates != layout.coordinates)
      layout.coordinates = {CoordinateFormat::Kind::f64, {1, 1, 1}, {0, 0, 0}};
  }
  return std::unique_ptr<PointSource>(
      std::make_unique<Concatenation>(std::move(sources), std::move(layout), std::move(warnings)));
}

}  // namespace mapcodec
