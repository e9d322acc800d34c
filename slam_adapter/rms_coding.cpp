// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rms_coding.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/log_secant.hpp"

namespace mapcodec {
namespace {

// A uniform cell's root mean square distance from its centre, in sides.
constexpr double kRmsOfCell = 0.5;
// Of what may be spent: aimed at, and enough not to look further.
constexpr double kAim = 0.99, kEnough = 0.975;

double larger_rms(const EncodedTile& t) {
  return std::max(t.rms_forward_m, t.rms_backward_m);
}

TileSettings surfaces_of(const RmsTile& tile, double step_m) {
  TileSettings s;
  s.codec = CodecId::surface;
  s.step_m = step_m;
  s.borders = tile.borders;
  return s;
}

class TileForRms {
 public:
  TileForRms(const RmsTile& tile, const MapSchema& schema, double rms_m, double start_m)
      : tile_(tile), schema_(schema), bare_(positions_alone(schema)), rms_m_(rms_m), start_m_(start_m) {}

  Result<EncodedTile> encode() {
    try_points();
    try_surfaces();
    if (!best_) return make_error(ErrorCode::kPromiseBroken, "no coding of a tile keeps the promise");
    return encode_tile(tile_.points, schema_, settings_);
  }

 private:
  bool consider(const TileSettings& settings, const EncodedTile& t) {
    const double rms = larger_rms(t);
    if (rms <= rms_m_ && (!best_ || t.bytes.size() < *best_)) {
      best_ = t.bytes.size();
      settings_ = settings;
    }
    return rms <= rms_m_ && rms >= kEnough * rms_m_;
  }

  void try_points() {
    TileSettings s;
    s.step_m = 0.995 * rms_m_ / kRmsOfCell;
    for (int i = 0; i < 3; ++i) {
      const auto t = encode_tile(tile_.points, bare_, s);
      if (!t.ok()) return;
      if (consider(s, *t) || t->errors.rms_m <= rms_m_) return;
      s.step_m *= 0.995 * rms_m_ / t->errors.rms_m;  // clusters off the cells' centres
    }
  }

  void try_surfaces() {
    constexpr double kClearlyPoints = 1.6;
    TileSettings s = surfaces_of(tile_, start_m_);
    LogSecant secant(kAim * rms_m_, 0.8);
    for (int i = 0; i < 6; ++i) {
      const auto t = encode_tile(tile_.points, bare_, s);
      if (!t.ok() || consider(s, *t)) return;
      const double rms = larger_rms(*t);
      const bool hopeless =
          rms > rms_m_ && best_ && double(t->bytes.size()) > kClearlyPoints * double(*best_);
      if (hopeless) return;
      s.step_m = secant.next(s.step_m, rms);
    }
  }

  const RmsTile& tile_;
  const MapSchema& schema_;
  const MapSchema bare_;
  const double rms_m_, start_m_;
  TileSettings settings_;
  std::optional<std::size_t> best_;
};

double first_step(const MapSchema& schema, double rms_m) {
  return schema.step_m > 0 ? schema.step_m : 0.5 * rms_m;
}

std::size_t bytes_of(const std::vector<EncodedTile>& tiles) {
  std::size_t bytes = 0;
  for (const EncodedTile& t : tiles) bytes += t.bytes.size();
  return bytes;
}

/// Of all points together: the larger direction [m].
double pooled_rms(const std::vector<EncodedTile>& tiles) {
  double forward = 0, came = 0, backward = 0, stored = 0;
  for (const EncodedTile& t : tiles) {
    const auto in = double(t.input_points), out = double(t.points);
    forward += in * t.rms_forward_m * t.rms_forward_m;
    backward += out * t.rms_backward_m * t.rms_backward_m;
    came += in;
    stored += out;
  }
  return std::sqrt(std::max(came > 0 ? forward / came : 0, stored > 0 ? backward / stored : 0));
}

class TilesForRms {
 public:
  TilesForRms(std::span<const RmsTile> tiles, const MapSchema& schema, double rms_m, const RunEach& run)
      : tiles_(tiles), schema_(schema), bare_(positions_alone(schema)), rms_m_(rms_m), run_(run) {}

  Result<std::vector<EncodedTile>> encode() {
    const double start = first_step(schema_, rms_m_);
    MAPCODEC_ASSIGN(std::vector<EncodedTile> apart,
                    code([&](const RmsTile& t) { return encode_for_rms(t, schema_, rms_m_, start); }));
    if (tiles_.size() < 2) return apart;
    const std::optional<double> step = common_step(start);
    if (!step) return apart;
    auto together = code([&](const RmsTile& t) { return encode_like_surface(t, *step); });
    const bool better =
        together.ok() && pooled_rms(*together) <= rms_m_ && bytes_of(*together) < bytes_of(apart);
    return better ? std::move(together) : Result<std::vector<EncodedTile>>(std::move(apart));
  }

 private:
  using Coding = std::function<Result<EncodedTile>(const RmsTile&)>;

  Result<std::vector<EncodedTile>> code(const Coding& coding) const {
    std::vector<EncodedTile> coded(tiles_.size());
    MAPCODEC_TRY(run_(tiles_.size(), [&](std::size_t i) -> Status {
      MAPCODEC_ASSIGN(coded[i], coding(tiles_[i]));
      return {};
    }));
    return coded;
  }

  /// The step of surfaces at which all points together have nearly the rms.
  std::optional<double> common_step(double step) const {
    LogSecant secant(kAim * rms_m_, 0.8);
    std::optional<double> best;
    for (int i = 0; i < 6; ++i) {
      const auto coded =
          code([&](const RmsTile& t) { return encode_tile(t.points, bare_, surfaces_of(t, step)); });
      if (!coded.ok()) return best;
      const double rms = pooled_rms(*coded);
      if (rms <= rms_m_ && (!best || step > *best)) best = step;
      if (rms <= rms_m_ && rms >= kEnough * rms_m_) return best;
      step = secant.next(step, rms);
    }
    return best;
  }

  /// With the error that surfaces at this step have, by whatever is cheapest.
  Result<EncodedTile> encode_like_surface(const RmsTile& tile, double step) const {
    MAPCODEC_ASSIGN(const EncodedTile t, encode_tile(tile.points, bare_, surfaces_of(tile, step)));
    return encode_for_rms(tile, schema_, std::clamp(larger_rms(t), 1e-3 * rms_m_, 1.5 * rms_m_) * (1 + 1e-9),
                          step);
  }

  std::span<const RmsTile> tiles_;
  const MapSchema& schema_;
  const MapSchema bare_;
  const double rms_m_;
  const RunEach& run_;
};

}  // namespace

Result<EncodedTile> encode_for_rms(const RmsTile& tile, const MapSchema& schema, double rms_m,
                                   double start_m) {
  return TileForRms(tile, schema, rms_m, start_m > 0 ? start_m : first_step(schema, rms_m)).encode();
}

Result<std::vector<EncodedTile>> encode_for_rms_together(std::span<const RmsTile> tiles,
                                                         const MapSchema& schema, double rms_m,
                                                         const RunEach& run) {
  return TilesForRms(tiles, schema, rms_m, run).encode();
}

}  // namespace mapcodec
