// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mixture_search.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "slam_adapter/coding_plan.hpp"
#include "slam_adapter/log_secant.hpp"

namespace mapcodec {
namespace {

constexpr int kTries = 6, kFinerTries = 8;
constexpr double kAim = 0.99, kEnough = 0.98, kLeast = 0.95;  // of the rms
constexpr double kRmsPerStep = 0.7;  // by how much its logarithm grows with that of the step
// Codings of one tile at nearly equal steps differ as by chance, which the choice can use.
constexpr double kLeastChange = 0.03, kSideways = 0.05;
constexpr double kNearVoxels[] = {0.86, 0.93, 1, 1.07, 1.15};  // of the side that belongs to the last step
// A tile whose surfaces cost so many times what its points do gets no more of them.
constexpr double kHopeless = 1.5;
constexpr double kNearlyFree = 0.5;  // bits per point
// A uniform cell's root mean square distance from its centre, in sides.
constexpr double kRmsOfCell = 0.5;
constexpr double kVoxelRms = 0.995;  // of the rms: what a voxel is made for
// Directions whose errors differ by more are worth a search with another weight, changed by so much.
constexpr double kBalanced = 0.1, kOtherWeight = 0.55;

CodingFigures figures_of(const EncodedTile& t) {
  const auto in = double(t.input_points), out = double(t.points);
  return {8 * double(t.bytes.size()), in * t.rms_forward_m * t.rms_forward_m,
          out * t.rms_backward_m * t.rms_backward_m};
}

/// What the density of a tile is worth, for all its points [bits].
double density_bits(const EncodedTile& t, double rms_m) {
  const auto points = double(t.input_points);
  return points * worth_of_density(8 * double(t.bytes.size()) / points, t.errors.density_error, rms_m);
}

/// Forward RMS over backward RMS.
double balance_of(std::span<const TileTry> tiles) {
  double in = 0, out = 0, forward = 0, backward = 0;
  for (const TileTry& t : tiles) {
    const CodingFigures f = figures_of(t.coded);
    in += double(t.coded.input_points);
    out += double(t.coded.points);
    forward += f.forward;
    backward += f.backward;
  }
  return forward > 0 && backward > 0 ? std::sqrt(forward / in / (backward / out)) : 1;
}

/// The next step, at which not quite the same is seen again.
double moved(double from, double to, bool coarser) {
  if (std::abs(std::log(to / from)) >= kLeastChange) return to;
  return from * (coarser ? 1 + kSideways : 1 / (1 + kSideways));
}

}  // namespace

Status MixtureSearch::try_all(std::span<const std::size_t> tiles, const TileSettings& settings) {
  MAPCODEC_ASSIGN(auto tries, code_(tiles, settings));
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (!tries[i]) continue;
    const EncodedTile& t = tries[i]->coded;
    CodingFigures figures = figures_of(t);
    sizes_[tiles[i]].push_back(figures);
    figures.bits += density_bits(t, rms_m_);
    figures_[tiles[i]].push_back(figures);
    tried_[tiles[i]].push_back(std::move(*tries[i]));
  }
  return {};
}

Status MixtureSearch::try_points(double step_m) {
  std::vector<std::size_t> all(tried_.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  points_.step_m = step_m;
  return try_all(all, points_);
}

/// As they would be coded if there were no surfaces; clusters off the cells' centres lose more than usual.
Status MixtureSearch::try_points_alone() {
  constexpr int kMostTries = 3;
  double step_m = kVoxelRms * rms_m_ / kRmsOfCell;
  for (int i = 0; i < kMostTries; ++i) {
    MAPCODEC_TRY(try_points(step_m));
    if (!is_complete()) return {};
    std::vector<std::size_t> last;
    for (const Codings& c : figures_) last.push_back(c.size() - 1);
    const double rms = rms_of(last);
    if (rms <= rms_m_) return {};
    step_m *= kVoxelRms * rms_m_ / rms;
  }
  return {};
}

bool MixtureSearch::is_complete() const {
  return std::none_of(figures_.begin(), figures_.end(), [](const Codings& c) { return c.empty(); });
}

double MixtureSearch::rms_of(std::span<const std::size_t> choice) const {
  double points_in = 0, points_out = 0;
  for (std::size_t i = 0; i < choice.size(); ++i) {
    points_in += double(tried_[i][choice[i]].coded.input_points);
    points_out += double(tried_[i][choice[i]].coded.points);
  }
  const MixtureLimit lost = lost_by(figures_, choice);
  return std::sqrt(std::max(points_in > 0 ? lost.forward / points_in : 0,
                            points_out > 0 ? lost.backward / points_out : 0));
}

/// Tiles that points code far better at this price.
void MixtureSearch::drop_hopeless(double bit_price) {
  std::erase_if(surfaces_, [&](std::size_t tile) {
    double surface = INFINITY, points = INFINITY;
    for (std::size_t k = 0; k < tried_[tile].size(); ++k) {
      const CodingFigures& f = figures_[tile][k];
      double& least = tried_[tile][k].settings.codec == CodecId::surface ? surface : points;
      least = std::min(least, (f.forward + f.backward) / 2 + bit_price * f.bits);
    }
    return surface > kHopeless * points;
  });
}

/// Where surfaces are nearly free they may as well be finer, and others spend what that leaves.
Status MixtureSearch::try_finer(TileSettings surfaces) {
  const auto is_dear = [&](std::size_t tile) {
    return std::none_of(tried_[tile].begin(), tried_[tile].end(), [](const TileTry& t) {
      return t.settings.codec == CodecId::surface &&
             8 * double(t.coded.bytes.size()) < kNearlyFree * double(t.coded.input_points);
    });
  };
  std::erase_if(surfaces_, is_dear);
  surfaces.step_m /= 2;
  return surfaces_.empty() ? Status{} : try_all(surfaces_, surfaces);
}

std::optional<std::vector<std::size_t>> MixtureSearch::best() const {
  double points_in = 0, points_out = 0;
  for (const auto& tried : tried_) {
    points_in += double(tried.front().coded.input_points);
    points_out += double(tried.front().coded.points);
  }
  const double square = rms_m_ * rms_m_;
  const MixtureLimit limit{points_in * square, points_out * square};
  auto choice = cheapest_within(within_tile_rms(figures_), limit);
  // Density is a wish, spending the promise is asked for.
  if (choice && rms_of(*choice) < kLeast * rms_m_) choice = cheapest_within(within_tile_rms(sizes_), limit);
  return choice;
}

std::vector<Codings> MixtureSearch::within_tile_rms(std::vector<Codings> tiles) const {
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    for (std::size_t k = 0; k < tiles[i].size(); ++k) {
      const EncodedTile& t = tried_[i][k].coded;
      if (std::max(t.rms_forward_m, t.rms_backward_m) > most_rms_m_) tiles[i][k].bits = INFINITY;
    }
  }
  return tiles;
}

Result<std::optional<std::vector<TileTry>>> MixtureSearch::run(TileSettings surfaces, bool with_points) {
  points_ = surfaces;
  points_.codec = CodecId::points;
  surfaces.codec = CodecId::surface;
  surfaces_.resize(tried_.size());
  std::iota(surfaces_.begin(), surfaces_.end(), std::size_t{0});
  if (with_points) MAPCODEC_TRY(try_points_alone());
  LogSecant secant(kAim * rms_m_, kRmsPerStep);
  CodingPlan plan;
  plan.tiles = surfaces;
  bool below = false, above = false;
  for (int i = 0; i < kTries && !surfaces_.empty(); ++i) {
    const double step_m = surfaces.step_m;
    MAPCODEC_TRY(try_all(surfaces_, surfaces));
    if (with_points) MAPCODEC_TRY(try_points(plan.voxels_per_step() * step_m));
    if (!is_complete()) break;
    const double price = surfaces.trade.bit_price * step_m * step_m;
    const double rms = rms_of(mixture_at(figures_, price));
    (rms <= rms_m_ ? below : above) = true;
    if (below && above) {
      const auto choice = best();
      if (choice && rms_of(*choice) >= kEnough * rms_m_) break;
    }
    if (with_points) drop_hopeless(price);
    surfaces.step_m = moved(step_m, secant.next(step_m, rms), rms <= rms_m_);
  }
  const bool any_surfaces = !surfaces_.empty();
  if (is_complete()) MAPCODEC_TRY(try_finer(surfaces));
  // Points are tried fast: so the last of the promise is spent.
  if (with_points && any_surfaces) {
    for (const double near : kNearVoxels)
      MAPCODEC_TRY(try_points(near * plan.voxels_per_step() * surfaces.step_m));
  }
  std::optional<std::vector<TileTry>> settled;
  if (!is_complete()) return settled;
  auto choice = best();
  // A tile of few points may lie beyond its limit in all of these.
  double step_m = points_.step_m;
  for (int i = 0; i < kFinerTries && with_points && !choice; ++i) {
    MAPCODEC_TRY(try_points(step_m /= 2));
    choice = best();
  }
  if (!choice) return settled;
  settled.emplace();
  for (std::size_t i = 0; i < tried_.size(); ++i) settled->push_back(std::move(tried_[i][(*choice)[i]]));
  return settled;
}

double cost_of(std::span<const TileTry> tiles, double rms_m) {
  double bits = 0;
  for (const TileTry& t : tiles) bits += figures_of(t.coded).bits + density_bits(t.coded, rms_m);
  return bits;
}

Result<std::optional<std::vector<TileTry>>> search_mixture(std::size_t tiles, double rms_m,
                                                           const CodeTiles& code,
                                                           const TileSettings& surfaces, bool with_points,
                                                           double most_rms_m) {
  MAPCODEC_ASSIGN(auto best, MixtureSearch(tiles, rms_m, code, most_rms_m).run(surfaces, with_points));
  if (!best || surfaces.effort == Effort::fast) return best;
  const double balance = balance_of(*best);
  if (std::abs(balance - 1) <= kBalanced) return best;
  TileSettings other = surfaces;
  double& weight = other.trade.forward_weight;
  weight = std::min(balance < 1 ? weight * kOtherWeight : weight / kOtherWeight, 1.0);
  MAPCODEC_ASSIGN(auto second, MixtureSearch(tiles, rms_m, code, most_rms_m).run(other, with_points));
  if (second && cost_of(*second, rms_m) < cost_of(*best, rms_m)) return second;
  return best;
}

}  // namespace mapcodec
