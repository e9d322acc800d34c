// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/schema_choice.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "slam_adapter/lattice.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec {
namespace {

// The sample's RMS is within about 0.1 % of the map's: with this margin a second coding is rarely needed.
constexpr double kRmsMargin = 0.997;

bool is_asked(const std::string& name, const std::vector<std::string>& asked) {
  if (asked.size() == 1 && asked[0] == "all") return true;
  if (asked.size() == 1 && asked[0] == "none") return name == kOrderChannel;
  return std::find(asked.begin(), asked.end(), name) != asked.end() || name == kOrderChannel;
}

bool can_be_bounded_color(const ChannelInfo& c) {
  return c.name == "rgb" && c.components == 3 && (c.scalar == ScalarType::u8 || c.scalar == ScalarType::u16);
}

ChannelSchema choose_channel(const ChannelInfo& info, const std::optional<Bytes>& constant,
                             const CompressOptions& options) {
  ChannelSchema c;
  c.info = info;
  if (!is_asked(info.name, options.channels)) {
    c.kept = ChannelKept::dropped;
  } else if (constant && options.constants) {
    c.kept = ChannelKept::constant;
    c.constant = *constant;
  } else if (options.promise == PromiseKind::paper && !can_be_bounded_color(info)) {
    c.kept = ChannelKept::dropped;
  } else if (options.promise != PromiseKind::lossless && can_be_bounded_color(info) &&
             options.color_error > 0) {
    c.kept = ChannelKept::bounded;
    c.bound = options.color_error;
  }
  return c;
}

Status check_names(const PointCloud& layout, const std::vector<std::string>& asked) {
  for (const std::string& name : asked) {
    if (name == "all" || name == "none" || layout.find(name) != nullptr) continue;
    std::string known;
    for (const Channel& c : layout.channels) known += (known.empty() ? "" : ", ") + c.info.name;
    return make_error(ErrorCode::kInvalidArgument, "there is no channel '" + name + "' (there is: " +
                                                       (known.empty() ? "none" : known) + ")");
  }
  return {};
}

void choose_lattice(const Survey& survey, const CompressOptions& options, MapSchema& schema) {
  if (options.promise == PromiseKind::lossless || options.promise == PromiseKind::paper) return;
  schema.promise_value = options.promise_m;
  const Lattice lattice =
      options.promise == PromiseKind::max_error
          ? lattice_for_max_error(options.promise_m, schema.coordinates, survey.bounds, schema.origin)
          : lattice_for_rms(kRmsMargin * options.promise_m, schema.coordinates, survey.sample, schema.origin);
  schema.origin = lattice.origin;
  schema.step_m = lattice.step_m;
}

void say_what_is_dropped(const MapSchema& schema, const CompressOptions& options,
                         std::vector<std::string>& warnings) {
  for (const ChannelSchema& c : schema.channels) {
    if (c.kept != ChannelKept::dropped) continue;
    const bool resampled = options.promise == PromiseKind::paper && is_asked(c.info.name, options.channels);
    warnings.push_back("channel '" + c.info.name + "' is not kept" +
                       (resampled ? ": resampled points have none (--max-error keeps it)" : ", as asked"));
  }
}

struct NamedNumber {
  const char* name;
  double value;
};

Status check_all(std::initializer_list<NamedNumber> numbers, bool may_be_zero) {
  for (const NamedNumber& n : numbers) {
    // Written so that NaN fails.
    if (std::isfinite(n.value) && (n.value > 0 || (may_be_zero && n.value == 0))) continue;
    return make_error(ErrorCode::kInvalidArgument,
                      std::string("the ") + n.name + " is not a " +
                          (may_be_zero ? "number of 0 or more" : "positive number"));
  }
  return {};
}

}  // namespace

Status check_numbers(const CompressOptions& o) {
  const bool bounded = o.promise == PromiseKind::rms || o.promise == PromiseKind::max_error;
  MAPCODEC_TRY(check_all({{"error bound", bounded ? o.promise_m : 1},
                          {"unit", o.unit_m},
                          {"target ratio", o.target_ratio.value_or(1)},
                          {"target of bits per point", o.target_bits_per_point.value_or(1)},
                          {"plane distance", o.paper.distance_m},
                          {"alpha radius", o.paper.alpha_m}},
                         false));
  return check_all({{"colour error", o.color_error},
                    {"tile size", o.tile_size_m},
                    {"share to process", o.paper.perc_process},
                    {"outlier radius", o.paper.outlier_radius_m},
                    {"least area density", o.paper.rel_area},
                    {"density outside", o.paper.outside_density},
                    {"contour reduction", o.paper.reduction_m},
                    {"step of the remaining points", o.paper.leftover_step_m}},
                   true);
}

Result<MapSchema> choose_schema(const Survey& survey, const CompressOptions& options, const Vec3& origin,
                                double tile_size_m, std::vector<std::string>& warnings) {
  if (survey.bounds.empty() && options.promise != PromiseKind::lossless) {
    return make_error(ErrorCode::kEmpty, "holds no point with a finite position");
  }
  MAPCODEC_TRY(check_names(survey.layout, options.channels));
  MapSchema schema;
  schema.promise = options.promise;
  schema.origin = origin;
  schema.tile_size_m = tile_size_m;
  schema.coordinates = survey.layout.coordinates;
  choose_lattice(survey, options, schema);
  for (std::size_t i = 0; i < survey.layout.channels.size(); ++i) {
    schema.channels.push_back(
        choose_channel(survey.layout.channels[i].info, survey.constant_channels[i], options));
  }
  say_what_is_dropped(schema, options, warnings);
  return schema;
}

std::uint64_t raw_bytes_per_point(const MapSchema& schema) {
  std::uint64_t bytes = 12;
  for (const ChannelSchema& c : schema.channels) {
    if (c.kept == ChannelKept::dropped || c.info.name == "alpha" || c.info.name == kOrderChannel) continue;
    // Colour counts as PCD packs it, alpha included.
    bytes += c.info.name == "rgb" ? 4 * scalar_size(c.info.scalar) : c.info.stride();
  }
  return bytes;
}

}  // namespace mapcodec
