// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/surface_optimizer.hpp"

#include <bit>

#include "mapcodec/codec/surface_prices.hpp"
#include "mapcodec/codec/surface_voxel_errors.hpp"

namespace mapcodec::surface {
namespace {

// A leaf whose error could be paid with so few bits is not divided to see whether that is better: measured,
// less costs time and gains nothing.
constexpr double kEnoughBits = 20, kEnoughBitsOfFew = 0.5;
// A plane is handed down if it fits so many points so well [steps^2, on average]. Others help the halves
// little, and once told they keep better ones out: 4 for 6 points took 7 % more bits on thirteen maps.
constexpr double kPointsToHandDown = 12, kThinToHandDown = 0.7;
constexpr std::uint32_t kWedgePoints =
    6;  // the format's least number of points of a leaf with a wedge or thickness

/// A leaf that could be.
struct Candidate {
  double error = kNever;   ///< weighted squared distances
  double excess = kNever;  ///< of it, what dividing could save
  double bits = 0;
  bool own = false, wedged = false, block = false;
  std::uint8_t noise = 0;
  Wedge wedge;
};

/// A cell's planes, and what they would cost.
struct Planes {
  const Plane* inherited = nullptr;
  Plane own;
  bool has_own = false;
  double inherited_error = kNever, own_error = kNever;
  double own_bits = 0, none_bits = 0;
  Polygon inherited_polygon, own_polygon;  ///< empty without the plane
};

/// What a voxel of a block costs [bits, its error included], by how many points it holds: learnt from blocks
/// that were looked at. Most cells cost so much less as leaves or divided that they need no look.
class UsualBlocks {
 public:
  [[nodiscard]] double promising(std::uint32_t points, std::uint32_t voxels) const {
    const unsigned k = kind(points, voxels);
    return (k == 0 ? kPromisingOfSingles : kPromising) * cost_[k] * voxels;
  }
  void learn(std::uint32_t points, std::uint32_t voxels, double cost) {
    double& usual = cost_[kind(points, voxels)];
    usual += 0.02 * (std::min(cost / voxels, 3 * usual) - usual);
  }

 private:
  // Of what is usual: more loses blocks that are worth their bits, of which voxels of single points are few.
  static constexpr double kPromising = 0.5, kPromisingOfSingles = 0.75;
  static unsigned kind(std::uint32_t points, std::uint32_t voxels) {
    return std::min(static_cast<unsigned>(std::bit_width(points / voxels)) - 1, 3u);
  }
  std::array<double, 4> cost_{6, 6, 6, 6};
};

class Optimizer {
 public:
  Optimizer(std::span<const Units> points, unsigned depth, Models& models, const SurfaceTrade& trade)
      : points_(points),
        depth_(depth),
        forward_(trade.forward_weight),
        lambda_(trade.bit_price * kStep2),
        prices_(models),
        errors_(points, depth) {
    if (models.voxel_bits > 0) voxels_ = VoxelErrors(points, models.voxel_bits, forward_, lambda_);
  }

  std::vector<Choice> run() {
    const auto d = static_cast<std::uint8_t>(depth_);
    solve({0, points_.size(), {0, 0, 0}, {d, d, d}, 0}, nullptr);
    return std::move(choices_);
  }

 private:
  /// Appends the best choices for a cell and all below it; returns their cost, error + lambda x bits.
  double solve(const TreeCell& cell, const Plane* inherited) {
    const std::size_t me = choices_.size();
    choices_.emplace_back();
    choices_[me].count = cell.count();
    if (cell.level >= 3 * depth_) return 0.25 * cell.count();
    if (cell.count() == 1) return solve_single(me, cell, inherited);
    const CellContext context = Prices::context(cell);
    const Moments moments = errors_.moments(cell);
    const Planes planes = find_planes(cell, context, moments, inherited);

    Candidate best;
    consider_center(cell, moments, context, planes, best);
    // A leaf that is too good to be divided saves the recursion; one that cannot be as good as that is looked
    // at after it, when there is a cost to beat.
    const double enough = lambda_ * (cell.count() > LeafErrors::kFew ? kEnoughBits : kEnoughBitsOfFew);
    const double least_error = std::min(planes.own_error, planes.inherited_error);
    const bool first =
        cell.count() <= LeafErrors::kFew || mix(least_error, kBackShare * least_error) <= enough;
    if (first) consider_planes(cell, context, planes, kNever, best);
    if (best.excess <= enough) return take_leaf(me, cell, best, planes.own);

    const bool sets = pays_below(cell, planes);
    const double divided = divide(me, cell, context, planes, sets, cost_of(best));
    if (!first) consider_planes(cell, context, planes, divided, best);
    consider_block(cell, context, planes, divided, best);
    learn(cell, std::min(divided, cost_of(best)));
    if (divided >= cost_of(best)) {
      choices_.resize(me + 1);
      return take_leaf(me, cell, best, planes.own);
    }
    take_division(me, sets, planes.own);
    return divided;
  }

  [[nodiscard]] double mix(double forth, double back) const {
    return forward_ * forth + (1 - forward_) * back;
  }
  [[nodiscard]] double cost_of(const Candidate& c) const { return c.error + lambda_ * c.bits; }
  void take_if_better(const Candidate& c, Candidate& best) const {
    if (cost_of(c) < cost_of(best)) best = c;
  }
  void set_error(Candidate& c, const LeafError& e) const {
    c.error = mix(e.forth, e.back);
    c.excess = mix(e.beside_forth, e.beside_back);
  }

  /// Squared distances beyond what coding every point apart would cost.
  [[nodiscard]] double hopeless(const TreeCell& cell) const {
    return lambda_ * std::max(4.0, 2 * average_) * cell.count();
  }
  void learn(const TreeCell& cell, double cost) {
    if (cell.count() >= 64) average_ += 0.1 * (cost / (lambda_ * cell.count()) - average_);
  }

  Planes find_planes(const TreeCell& cell, const CellContext& c, const Moments& m,
                     const Plane* inherited) const {
    Planes r;
    r.inherited = inherited;
    if (inherited != nullptr) {
      r.inherited_error = squared_distances(m, cell.shape, *inherited);
      r.inherited_polygon = polygon_of(*inherited, cell.shape, prices_.room(cell));
    }
    r.has_own =
        cell.count() >= 3 && fit_plane(m, cell.shape, inherited != nullptr ? inherited->axis : 3, r.own);
    if (!r.has_own) return r;
    r.own_error = squared_distances(m, cell.shape, r.own);
    r.own_bits = prices_.plane(c, r.own, inherited, cell.shape);
    r.none_bits = prices_.no_plane(c, inherited != nullptr);
    if (r.own_error < hopeless(cell)) cheapen(cell, c, m, r);
    r.own_polygon = polygon_of(r.own, cell.shape, prices_.room(cell));
    return r;
  }

  /// Moves the parameters of a cell's own plane towards what is expected where that saves more bits than it
  /// costs error.
  void cheapen(const TreeCell& cell, const CellContext& c, const Moments& m, Planes& planes) const {
    Plane guess{0, 0, 0, planes.own.axis};
    if (planes.inherited != nullptr) {
      guess = *planes.inherited;
      if (!turn_to(guess, planes.own.axis, cell.shape)) guess = {0, 0, 0, planes.own.axis};
    }
    constexpr std::int32_t kStep = 1 << kPlaneStepBits;
    std::int32_t Plane::*const fields[3] = {&Plane::a, &Plane::b, &Plane::h};
    bool moved = true;
    for (int round = 0; round < 2 && moved; ++round) {
      moved = false;
      for (auto field : fields) {
        const std::int32_t target = (guess.*field + kStep / 2) >> kPlaneStepBits << kPlaneStepBits;
        if (planes.own.*field == target) continue;
        Plane trial = planes.own;
        trial.*field += planes.own.*field > target ? -kStep : kStep;
        moved = take_if_cheaper(trial, cell, c, m, planes) || moved;
      }
    }
  }
  bool take_if_cheaper(const Plane& trial, const TreeCell& cell, const CellContext& c, const Moments& m,
                       Planes& planes) const {
    const double weight = mix(1, kBackShare);
    const double error = squared_distances(m, cell.shape, trial);
    const double bits = prices_.plane(c, trial, planes.inherited, cell.shape);
    if (weight * error + lambda_ * bits >= weight * planes.own_error + lambda_ * planes.own_bits)
      return false;
    planes.own = trial;
    planes.own_error = error;
    planes.own_bits = bits;
    return true;
  }

  /// Whether the halves should inherit a cell's own plane instead of the one it inherited.
  [[nodiscard]] bool pays_below(const TreeCell& cell, const Planes& p) const {
    const double n = cell.count();
    return p.has_own && n >= kPointsToHandDown && p.own_error < kThinToHandDown * n * kStep2 &&
           forward_ * (std::min(p.inherited_error, 1e30) - p.own_error) >
               lambda_ * (p.own_bits - p.none_bits);
  }

  void consider_center(const TreeCell& cell, const Moments& m, const CellContext& c, const Planes& p,
                       Candidate& best) const {
    const bool inherits = p.inherited != nullptr;
    if (p.inherited_polygon.size >= 3) return;
    Candidate r;
    set_error(r, errors_.at_center(cell, m));
    r.bits = p.none_bits + prices_.leaf(cell, c, inherits ? PlaneState::inherited : PlaneState::none);
    take_if_better(r, best);
  }

  /// @param limit  what a leaf must stay below to be of use.
  void consider_planes(const TreeCell& cell, const CellContext& c, const Planes& p, double limit,
                       Candidate& best) {
    if (p.inherited != nullptr && forward_ * p.inherited_error < hopeless(cell)) {
      consider_plane(cell, c, p, false, limit, best);
    }
    if (!p.has_own || forward_ * p.own_error >= hopeless(cell)) return;
    // Of few points a plane of their own can save little more than their distances to the inherited one.
    const bool enough = cell.count() <= LeafErrors::kFew && best.error < kNever &&
                        p.inherited_error - p.own_error < lambda_ * (p.own_bits - p.none_bits);
    if (p.inherited == nullptr || !enough) consider_plane(cell, c, p, true, limit, best);
  }

  void consider_plane(const TreeCell& cell, const CellContext& c, const Planes& p, bool own, double limit,
                      Candidate& best) {
    const Plane& plane = own ? p.own : *p.inherited;
    const double beside = own ? p.own_error : p.inherited_error;
    Candidate r;
    r.own = own;
    r.bits = (own ? p.own_bits : p.none_bits) +
             prices_.leaf(cell, c, own ? PlaneState::own : PlaneState::inherited);
    if (0.25 * mix(beside, 0) + lambda_ * r.bits >= std::min(limit, cost_of(best))) return;
    const Polygon& polygon = own ? p.own_polygon : p.inherited_polygon;
    if (polygon.size < 3) return;
    if (cell.count() <= LeafErrors::kFew) {
      consider_few(cell, c, plane, polygon, beside, r, best);
    } else {
      consider_many(cell, c, plane, polygon, beside, r, limit, best);
    }
  }

  void consider_few(const TreeCell& cell, const CellContext& c, const Plane& plane, const Polygon& polygon,
                    double beside, Candidate r, Candidate& best) {
    const bool with_extras = cell.count() >= kWedgePoints;
    const double bare = r.bits + (with_extras ? prices_.wedge(c, nullptr) : 0);
    const bool may_be_thick = with_extras && beside >= kLeastThickness2 * cell.count();
    errors_.decode_few(cell, plane, polygon);
    for (std::uint8_t noise = 0; noise <= (may_be_thick ? 2 : 0); ++noise) {
      r.noise = noise;
      r.bits = bare + (with_extras ? prices_.noise(c, noise, false) : 0);
      set_error(r, errors_.of_few(cell, plane, noise));
      take_if_better(r, best);
    }
  }

  void consider_many(const TreeCell& cell, const CellContext& c, const Plane& plane, const Polygon& polygon,
                     double beside, Candidate r, double limit, Candidate& best) {
    const double flags = r.bits;
    const double rough = roughness_of(cell, plane, beside);
    r.noise = best_noise(cell, area_of(cell.shape, plane, polygon), beside, rough);
    r.bits = flags + prices_.wedge(c, nullptr) + prices_.noise(c, r.noise, false);
    // A leaf that would lose even if nothing were missed or beside the surface is not looked at closer.
    const double least = mix(beside, kBackShare * beside);
    if ((r.noise == 0 ? 1.0 : 0.3) * least + lambda_ * r.bits >= std::min(limit, cost_of(best))) return;
    const Shape shape{cell, plane, polygon, beside, rough};
    double missed = 0;
    if (probe(shape, std::min(limit, cost_of(best)), r, missed)) take_if_better(r, best);
    if (missed < lambda_ * kWedgeBits || least + lambda_ * (r.bits + 8) >= std::min(limit, cost_of(best)))
      return;
    consider_wedge(shape, c, flags, r, limit, best);
  }

  /// A surface in a cell that could be a leaf's.
  struct Shape {
    const TreeCell& cell;
    const Plane& plane;
    const Polygon& polygon;
    double beside, roughness;
  };

  void consider_wedge(const Shape& shape, const CellContext& c, double flags, Candidate r, double limit,
                      Candidate& best) {
    if (!errors_.find_wedge(shape.cell, shape.plane, shape.polygon, r.wedge)) return;
    Polygon polygon = shape.polygon;
    cut(polygon, r.wedge);
    if (polygon.size < 3) return;
    r.wedged = true;
    r.bits = flags + prices_.wedge(c, &r.wedge) + prices_.noise(c, r.noise, false);
    const Shape rest{shape.cell, shape.plane, polygon, shape.beside, shape.roughness};
    set_error(r, error_of(rest, 0, r.noise));
    if (cost_of(r) >= cost_of(best)) return;
    double missed = 0;
    if (probe(rest, std::min(limit, cost_of(best)), r, missed)) take_if_better(r, best);
  }

  [[nodiscard]] LeafError error_of(const Shape& s, double missed, std::uint8_t noise) const {
    return errors_.of_many(s.cell, s.plane, s.polygon, s.beside, missed, noise, s.roughness, lambda_);
  }

  /// Fills in the errors of a candidate: from a few probes first, and from many if it could win. `missed` is
  /// not exact where it is too much anyway.
  bool probe(const Shape& s, double to_beat, Candidate& r, double& missed) {
    const std::uint32_t n = s.cell.count();
    set_error(r, error_of(s, 0, r.noise));
    const double most =
        std::max((to_beat - cost_of(r)) / (1 - forward_), kWedgeBits * lambda_) * kAboveRounding;
    if (n > LeafErrors::kFewProbes) {
      missed = errors_.missed(s.cell, s.plane, s.polygon, LeafErrors::kFewProbes, most / kShareOfFew);
      set_error(r, error_of(s, kShareOfFew * missed, r.noise));
      if (cost_of(r) >= to_beat) return false;
    }
    missed = errors_.missed(s.cell, s.plane, s.polygon, std::min(n, LeafErrors::kManyProbes), most);
    set_error(r, error_of(s, missed, r.noise));
    return true;
  }

  static constexpr double kShareOfFew = 0.4;  // of what few probes miss: they may be wrong by so much
  static constexpr double kWedgeBits = 4;     // a wedge can save no less than it costs
  static constexpr double kAboveRounding = 1.0001;
  static constexpr double kLeastThickness2 = 16;  // [units^2]: thinner leaves are planes

  double roughness_of(const TreeCell& cell, const Plane& plane, double beside) const {
    const double mean = beside / cell.count();
    return mean < kLeastThickness2 ? 0 : errors_.roughness(cell, plane, mean);
  }

  /// How thick a leaf should be: as thick as its points are, if their heights have nothing to do with their
  /// neighbours'.
  std::uint8_t best_noise(const TreeCell& cell, double area, double beside, double roughness) const {
    if (beside / cell.count() < kLeastThickness2) return 0;
    std::uint8_t best = 0;
    double least = mix(beside, kBackShare * beside);
    for (std::uint8_t noise = 1; noise <= kMostNoise; ++noise) {
      double forth = 0, back = 0;
      thicken(cell.count(), area, beside, noise, roughness, forth, back);
      if (mix(forth, back) >= least) continue;
      least = mix(forth, back);
      best = noise;
    }
    return best;
  }

  void consider_block(const TreeCell& cell, const CellContext& c, const Planes& p, double limit,
                      Candidate& best) {
    if (!prices_.can_be_block(cell)) return;
    const PlaneState state = p.inherited != nullptr ? PlaneState::inherited : PlaneState::none;
    const double flags = p.none_bits + prices_.leaf(cell, c, state, true);
    const double to_beat = std::min(limit, cost_of(best));
    const std::uint32_t voxels = voxels_.count_in(cell);
    if (lambda_ * (flags + blocks_.promising(cell.count(), voxels)) >= to_beat) return;
    const auto errors = voxels_.errors_in(cell, errors_);
    Candidate r;
    for (std::uint8_t noise = 0; noise <= kMostNoise; ++noise) {
      Candidate t;
      t.block = true;
      t.noise = noise;
      t.error = t.excess = errors[noise];
      t.bits = flags + prices_.noise(c, noise, true);
      take_if_better(t, r);
    }
    r.bits += walk_block(cell, p.inherited, -1, (to_beat - cost_of(r)) / lambda_);
    blocks_.learn(cell.count(), voxels, cost_of(r) / lambda_);
    take_if_better(r, best);
  }

  /// Price of the halves of a block's cells down to its voxels, or part of it where that is more than `most`;
  /// writes them down as choices from `me` on if that is >= 0.
  double walk_block(const TreeCell& cell, const Plane* plane, std::int64_t me, double most = kNever) {
    if (cell.shape[0] + cell.shape[1] + cell.shape[2] == 3 * prices_.voxel_bits()) return 0;
    const unsigned axis = cell.axis();
    const std::size_t split = cell.first_above(points_);
    const int halves = halves_of(cell, split);
    double bits = prices_.block_division(cell, plane, halves);
    for (unsigned h = 0; h < 2; ++h) {
      if (halves == static_cast<int>(2 - h)) continue;
      if (bits > most) return bits;
      const TreeCell child = cell.half(h == 1, split);
      Plane passed;
      if (plane != nullptr) passed = in_child(*plane, axis, h == 1, cell.shape[axis]);
      std::int64_t next = -1;
      if (me >= 0) {
        next = static_cast<std::int64_t>(choices_.size());
        choices_[static_cast<std::size_t>(me)].child[h] = static_cast<std::int32_t>(next);
        choices_.emplace_back();
        choices_.back().count = child.count();
      }
      bits += walk_block(child, plane != nullptr ? &passed : nullptr, next, most - bits);
    }
    return bits;
  }

  double take_leaf(std::size_t me, const TreeCell& cell, const Candidate& best, const Plane& own) {
    Choice& choice = choices_[me];
    choice.divided = false;
    choice.least_count = best.wedged ? kWedgePoints : (best.own ? 3 : 1);
    choice.child = {-1, -1};
    choice.own_plane = best.own;
    if (best.own) choice.plane = own;
    choice.wedged = best.wedged;
    choice.wedge = best.wedge;
    choice.block = best.block;
    choice.noise = best.noise;
    if (best.block) {
      choice.least_count = std::max(kLeastInBlock, voxels_.count_in(cell));
      walk_block(cell, nullptr, static_cast<std::int64_t>(me));
    }
    return cost_of(best);
  }

  void take_division(std::size_t me, bool sets, const Plane& own) {
    choices_[me].divided = true;
    choices_[me].own_plane = sets;
    std::uint32_t least = 0;
    for (const std::int32_t c : choices_[me].child) {
      if (c >= 0) least += choices_[static_cast<std::size_t>(c)].least_count;
    }
    choices_[me].least_count = sets ? std::max(3u, least) : least;
    if (sets) choices_[me].plane = own;
  }

  /// @param limit  cost beyond which the answer does not matter.
  double divide(std::size_t me, const TreeCell& cell, const CellContext& c, const Planes& p, bool sets,
                double limit) {
    const unsigned axis = cell.axis();
    const Plane* pass = sets ? &p.own : p.inherited;
    const PlaneState state =
        sets ? PlaneState::own : (pass != nullptr ? PlaneState::inherited : PlaneState::none);
    const std::size_t split = cell.first_above(points_);
    const int halves = halves_of(cell, split);
    double cost =
        lambda_ * ((sets ? p.own_bits : p.none_bits) +
                   prices_.division(cell, c, state, pass, sets ? p.own_polygon : p.inherited_polygon, halves,
                                    static_cast<std::uint32_t>(split - cell.begin)));
    for (unsigned h = 0; h < 2; ++h) {
      if (halves == static_cast<int>(2 - h)) continue;
      if (cost >= limit) return kNever;
      Plane passed;
      if (pass != nullptr) passed = in_child(*pass, axis, h == 1, cell.shape[axis]);
      choices_[me].child[h] = static_cast<std::int32_t>(choices_.size());
      cost += solve(cell.half(h == 1, split), pass != nullptr ? &passed : nullptr);
    }
    return cost;
  }

  /// One point: how far down its cell is halved. The choices of the cells on the way stand one after another.
  double solve_single(std::size_t me, TreeCell cell, const Plane* inherited) {
    Plane plane;
    if (inherited != nullptr) plane = *inherited;
    const Plane* const here = inherited != nullptr ? &plane : nullptr;
    const PlaneState state = here != nullptr ? PlaneState::inherited : PlaneState::none;
    double spent = 0, least = kNever;
    std::size_t keep = 0;
    halves_.clear();
    for (;;) {
      const CellContext c = Prices::context(cell);
      Polygon polygon;
      if (here != nullptr) polygon = polygon_of(plane, cell.shape, prices_.room(cell));
      const double error = errors_.of_single(cell, here, polygon);
      const double cost = error + lambda_ * (spent + prices_.leaf(cell, c, state));
      if (cost < least) {
        least = cost;
        keep = halves_.size();
      }
      if (error <= lambda_ * kEnoughBitsOfFew || cell.level >= 3 * depth_) break;
      const unsigned axis = cell.axis();
      const bool upper = static_cast<std::uint32_t>(points_[cell.begin][axis]) >= cell.border();
      spent += prices_.division(cell, c, state, here, polygon, upper ? 2 : 1, 0);
      halves_.push_back(upper);
      if (lambda_ * spent >= least) break;
      if (here != nullptr) plane = in_child(plane, axis, upper, cell.shape[axis]);
      cell = cell.half(upper, upper ? cell.begin : cell.end);
    }
    for (std::size_t i = 0; i < keep; ++i) {
      choices_[me + i].divided = true;
      choices_[me + i].child[halves_[i]] = static_cast<std::int32_t>(me + i + 1);
      choices_.emplace_back();
      choices_.back().count = 1;
    }
    return least;
  }

  std::span<const Units> points_;
  unsigned depth_;
  double forward_;
  double lambda_;
  double average_ = 6;  ///< bits that a point costs, its error included
  Prices prices_;
  LeafErrors errors_;
  VoxelErrors voxels_;
  UsualBlocks blocks_;
  std::vector<Choice> choices_;
  std::vector<std::uint8_t> halves_;  // scratch
};

}  // namespace

std::vector<Choice> choose_cells(std::span<const Units> points, unsigned depth, Models& models,
                                 const SurfaceTrade& trade) {
  return Optimizer(points, depth, models, trade).run();
}

}  // namespace mapcodec::surface
