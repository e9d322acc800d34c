// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_tile.hpp"

#include <cmath>
#include <optional>

#include "mapcodec/attribute/channel_encoder.hpp"
#include "mapcodec/codec/surface_color.hpp"
#include "mapcodec/codec/surface_encoder.hpp"
#include "mapcodec/codec/tile_sections.hpp"
#include "mapcodec/quality/density.hpp"
#include "mapcodec/quality/grid_nearest.hpp"

namespace mapcodec {
namespace {

constexpr std::uint8_t kUsualVoxelShift =
    7;  // a quarter of the surface step, where no colour asks for another

double root_mean(const Nearest& nearest) {
  double sum = 0;
  for (const double s : nearest.squared) sum += s;
  return std::sqrt(sum / static_cast<double>(nearest.squared.size()));
}

/// Largest error along an axis to the Euclidean neighbour: a bound for that to the nearest along all axes.
double largest_axis_distance(std::span<const Vec3> from, std::span<const Vec3> to, const Nearest& nearest) {
  double most = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vec3& q = to[nearest.index[i]];
    for (std::size_t d = 0; d < 3; ++d) most = std::max(most, std::abs(from[i][d] - q[d]));
  }
  return most;
}

void set_rms(double forward_m, double backward_m, SurfaceTile& r) {
  r.rms_forward_m = forward_m;
  r.rms_backward_m = backward_m;
  r.errors.rms_m = std::max(forward_m, backward_m);
}

void measure(const std::vector<Vec3>& original, const std::vector<Vec3>& decoded, const NearestPair& near,
             SurfaceTile& r) {
  set_rms(root_mean(near.forth), root_mean(near.back), r);
  r.errors.max_axis_error_m = std::max(largest_axis_distance(original, decoded, near.forth),
                                       largest_axis_distance(decoded, original, near.back));
  r.errors.density_error = density_error(original, decoded);
}

bool is_bounded_color(const ChannelSchema& c) {
  return c.kept == ChannelKept::bounded && c.info.name == "rgb" && c.info.components == 3 &&
         (c.info.scalar == ScalarType::u8 || c.info.scalar == ScalarType::u16);
}

/// The values of a channel on the decoded points, in tree order.
Channel on_decoded(const ChannelSchema& channel, const Channel& original, const NearestPair& near,
                   const SamePositions& ties) {
  const bool color = channel.info.name == "rgb" && channel.info.components == 3 &&
                     (channel.info.scalar == ScalarType::u8 || channel.info.scalar == ScalarType::u16);
  return color ? transfer_color(original, near, ties) : transfer_values(original, near.back);
}

}  // namespace

/// A tile whose positions are coded and measured.
struct TileMemo::Content {
  double step_m = 0;
  Effort effort = Effort::standard;
  SurfaceTrade trade;
  SurfaceEncoding encoding;
  std::uint8_t no_voxels = 0;  ///< its voxel shift without channels
  NearestPair near;            ///< empty where errors were only estimated
  SurfaceTile figures;         ///< without bytes
  std::optional<SamePositions> ties;
  std::unique_ptr<SurfaceColorEncoder> color;
};

namespace {

using Content = TileMemo::Content;

class TileChannels {
 public:
  TileChannels(const PointCloud& tile, const MapSchema& schema, const TileSettings& settings, Content& coded)
      : tile_(tile),
        schema_(schema),
        settings_(settings),
        content_(coded),
        coded_(coded_channels(schema, CodecId::surface)) {}

  /// Colour first: it decides on the voxels.
  Status encode(SurfaceTile& r) {
    if (coded_.empty()) return {};
    if (!content_.ties) content_.ties.emplace(tile_.xyz);
    r.channels.resize(coded_.size());
    const std::uint8_t depth = content_.encoding.header.depth;
    std::uint8_t shift =
        std::clamp(kUsualVoxelShift, surface::least_voxel_shift(depth), surface::most_voxel_shift(depth));
    std::size_t color = 0;
    while (color < coded_.size() && !is_bounded_color(schema_.channels[coded_[color]])) ++color;
    if (color < coded_.size()) {
      const std::size_t c = coded_[color];
      if (!content_.color) {
        content_.color = std::make_unique<SurfaceColorEncoder>(
            tile_.channels[c], content_.near, *content_.ties, content_.encoding, settings_.effort);
      }
      SurfaceColor e = content_.color->encode(schema_.channels[c].bound, settings_.color_slope);
      r.channels[color] = std::move(e.bytes);
      r.errors.color_error = e.error;
      r.least_color_error = e.least_error;
      shift = e.voxel_shift;
    }
    const surface::VoxelOrder sorted = set_voxels(content_.encoding, shift);
    for (std::size_t i = 0; i < coded_.size(); ++i) {
      if (i == color) continue;
      MAPCODEC_ASSIGN(r.channels[i], encode_other(coded_[i], sorted));
    }
    return {};
  }

 private:
  [[nodiscard]] Result<Bytes> encode_other(std::size_t c, const surface::VoxelOrder& sorted) const {
    const ChannelSchema& schema = schema_.channels[c];
    const Channel values = on_decoded(schema, tile_.channels[c], content_.near, *content_.ties);
    Channel ordered{values.info, Bytes(values.data.size())};
    for (std::size_t i = 0; i < sorted.order.size(); ++i) {
      std::memcpy(ordered.at(i), values.at(sorted.order[i]), values.info.stride());
    }
    MAPCODEC_ASSIGN(ChannelEncoding e, encode_channel(schema, ordered, sorted.voxels, settings_.effort));
    return std::move(e.bytes);
  }

  const PointCloud& tile_;
  const MapSchema& schema_;
  const TileSettings& settings_;
  Content& content_;
  std::vector<std::size_t> coded_;
};

Result<std::unique_ptr<Content>> code_positions(const PointCloud& tile, const MapSchema& schema,
                                                double step_m, const TileSettings& settings) {
  auto c = std::make_unique<Content>();
  c->step_m = step_m;
  c->effort = settings.effort;
  c->trade = settings.trade;
  const Quantizer lattice{schema.origin, step_m, schema.coordinates.kind};
  MAPCODEC_ASSIGN(c->encoding,
                  encode_surface(tile.xyz, lattice, {settings.effort, settings.borders, settings.trade}));
  c->no_voxels = c->encoding.header.voxel_shift;
  SurfaceTile& r = c->figures;
  const std::vector<Vec3>& decoded = c->encoding.decoded;
  for (const Vec3& p : decoded) r.bounds.add(p);
  if (settings.rough_errors && coded_channels(schema, CodecId::surface).empty()) {
    const RoughErrors rough = estimate_errors(tile.xyz, decoded);
    set_rms(std::sqrt(rough.forth), std::sqrt(rough.back), r);
  } else {
    c->near = find_nearest_pair(tile.xyz, decoded);
    measure(tile.xyz, decoded, c->near, r);
  }
  return c;
}

}  // namespace

TileMemo::TileMemo() = default;
TileMemo::TileMemo(TileMemo&&) noexcept = default;
TileMemo& TileMemo::operator=(TileMemo&&) noexcept = default;
TileMemo::~TileMemo() = default;

std::uint64_t TileMemo::bytes_for(std::uint64_t points) {
  constexpr std::uint64_t kPositions =
      sizeof(Vec3) + sizeof(surface::SubUnits) + 2 * (4 + sizeof(double)) + 12;
  constexpr std::uint64_t kColor = 250;  // a SurfaceColorEncoder of few voxels, about
  return points * (kPositions + kColor);
}

std::uint64_t TileMemo::bytes() const {
  return content == nullptr ? 0 : bytes_for(content->encoding.points.size());
}

Result<SurfaceTile> encode_surface_tile(const PointCloud& tile, const MapSchema& schema, double step_m,
                                        const TileSettings& settings, TileMemo* memo) {
  std::unique_ptr<Content> own;
  Content* coded = memo == nullptr ? nullptr : memo->content.get();
  const bool known = coded != nullptr && coded->step_m == step_m && coded->effort == settings.effort &&
                     coded->trade == settings.trade && coded->encoding.points.size() == tile.size();
  if (!known) {
    MAPCODEC_ASSIGN(own, code_positions(tile, schema, step_m, settings));
    coded = own.get();
  }
  SurfaceTile r = coded->figures;
  TileChannels channels(tile, schema, settings, *coded);
  coded->encoding.bytes.front() = coded->no_voxels;
  MAPCODEC_TRY(channels.encode(r));
  r.geometry = coded->encoding.bytes;
  if (memo != nullptr && own != nullptr && !coded->near.back.index.empty()) memo->content = std::move(own);
  return r;
}

}  // namespace mapcodec
