// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/novelty.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "mapcodec/geometry/quantizer.hpp"

namespace mapcodec {
namespace {

constexpr double kReach = 2.5;  // in promises: farther points are new whatever the others are

std::uint64_t mix(std::uint64_t h) {
  h ^= h >> 32;
  h *= 0xD6E8FEB86659FD93u;
  h ^= h >> 32;
  h *= 0xD6E8FEB86659FD93u;
  return h ^ (h >> 32);
}

/// From 64-bit keys to values, by open addressing: one cache miss a look.
template <class Value>
class KeyTable {
 public:
  /// For `more` new keys at once.
  void reserve(std::size_t more) {
    while (2 * (count_ + more + 1) > slots_.size()) grow();
  }
  /// Begins to bring what find or at will look at.
  void prefetch(std::uint64_t key) const {
    if (!slots_.empty()) __builtin_prefetch(&slots_[mix(key) & mask_]);
  }
  [[nodiscard]] const Value* find(std::uint64_t key) const {
    if (slots_.empty()) return nullptr;
    for (std::size_t at = mix(key) & mask_;; at = (at + 1) & mask_) {
      if (!slots_[at].used) return nullptr;
      if (slots_[at].key == key) return &slots_[at].value;
    }
  }
  /// Default-constructed where it is new.
  Value& at(std::uint64_t key) {
    if (2 * (count_ + 1) > slots_.size()) grow();
    return place(key);
  }
  [[nodiscard]] std::size_t bytes() const { return slots_.size() * sizeof(Slot); }

 private:
  struct Slot {
    std::uint64_t key = 0;
    Value value{};
    bool used = false;
  };
  Value& place(std::uint64_t key) {
    std::size_t at = mix(key) & mask_;
    while (slots_[at].used && slots_[at].key != key) at = (at + 1) & mask_;
    if (!slots_[at].used) {
      slots_[at] = {key, Value{}, true};
      ++count_;
    }
    return slots_[at].value;
  }
  void grow() {
    std::vector<Slot> old = std::move(slots_);
    slots_.assign(std::max<std::size_t>(64, 2 * old.size()), Slot{});
    mask_ = slots_.size() - 1;
    count_ = 0;
    for (const Slot& s : old) {
      if (s.used) place(s.key) = s.value;
    }
  }
  std::vector<Slot> slots_;
  std::size_t mask_ = 0, count_ = 0;
};

/// 21 bits an axis: a tile has no more cells.
std::uint64_t pack(std::int64_t x, std::int64_t y, std::int64_t z) {
  constexpr std::uint64_t kMask = (std::uint64_t{1} << 21) - 1;
  return (static_cast<std::uint64_t>(x) & kMask) | (static_cast<std::uint64_t>(y) & kMask) << 21 |
         (static_cast<std::uint64_t>(z) & kMask) << 42;
}

/// Cells of a multiple of the promise, each with its points as a chain.
class NearStored final : public StoredPoints {
 public:
  NearStored(double rms_m, const Vec3& origin)
      : rms_m_(rms_m), side_m_(2 * kReach * rms_m), origin_(origin) {}

  void add(const PointCloud& cloud, bool pending) override {
    const float later = pending ? kLater : 0;
    has_lasting_ = has_lasting_ || (!pending && !cloud.empty());
    for (const Vec3& p : cloud.xyz) {
      const Local l = local(p);
      Head& head = cells_.at(pack(l.cell[0], l.cell[1], l.cell[2]));
      // Points that stand side by side tell no more than one of them.
      if (nearest_in(head, l.at, kSame * kSame + later) > kSame * kSame + later) {
        points_.push_back({l.at, later, head});
        head = static_cast<Head>(points_.size());
      }
    }
  }

  Novelty look(const PointCloud& cloud, double rms_m, double by_chance_m) const override {
    std::vector<float> squares(cloud.size());
    double sum = 0, known = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      squares[i] = nearest(cloud.xyz[i]);
      sum += is_reached(squares[i]) ? squares[i] : 0;
      known += is_reached(squares[i]);
    }
    const double by_chance = (by_chance_m / rms_m_) * (by_chance_m / rms_m_);
    const double allowed = (rms_m / rms_m_) * (rms_m / rms_m_);
    return choose(cloud, squares, sum <= by_chance * known ? std::max(allowed, by_chance) : allowed);
  }

  [[nodiscard]] std::size_t bytes() const override {
    return cells_.bytes() + points_.capacity() * sizeof(Point);
  }

 private:
  static constexpr float kLater = float(kFoldedShare * kFoldedShare);
  static constexpr float kSame = 1.f / 3;  // in promises: what stands nearer than this counts as one
  using Head = std::uint32_t;              // 1 + index of a chain's first point; 0: none
  using Place = std::array<float, 3>;      // in promises, from the origin

  struct Point {
    Place at;
    float later;  ///< square of the distance that folding may yet add, in promises
    Head next;
  };
  struct Local {
    Place at;
    std::array<std::int64_t, 3> cell;
  };

  [[nodiscard]] Local local(const Vec3& p) const {
    Local l;
    for (std::size_t d = 0; d < 3; ++d) {
      const double offset = p[d] - origin_[d];
      l.at[d] = static_cast<float>(offset / rms_m_);
      l.cell[d] = static_cast<std::int64_t>(std::floor(offset / side_m_));
    }
    return l;
  }

  /// Square of the distance to the nearest of a chain once all is folded, or one that is no more than
  /// `enough`.
  [[nodiscard]] float nearest_in(Head head, const Place& at, float enough, float best = 1e9f) const {
    for (; head != 0 && best > enough; head = points_[head - 1].next) {
      const Point& p = points_[head - 1];
      const float x = p.at[0] - at[0], y = p.at[1] - at[1], z = p.at[2] - at[2];
      best = std::min(best, x * x + y * y + z * z + p.later);
    }
    return best;
  }

  /// The eight cells whose common corner is nearest hold all within half a cell's side: kReach.
  [[nodiscard]] float nearest(const Vec3& p) const {
    // Far below what matters, and it saves most of the search.
    const float enough = has_lasting_ ? 0.25f : kLater + 0.02f;
    const Local l = local(p);
    std::array<std::int64_t, 3> step{};
    for (std::size_t d = 0; d < 3; ++d) {
      const double inside = (p[d] - origin_[d]) / side_m_ - static_cast<double>(l.cell[d]);
      step[d] = inside < 0.5 ? -1 : 1;
    }
    float best = 1e9f;
    for (int corner = 0; corner < 8 && best > enough; ++corner) {
      const Head* head =
          cells_.find(pack(l.cell[0] + ((corner & 1) ? step[0] : 0), l.cell[1] + ((corner & 2) ? step[1] : 0),
                           l.cell[2] + ((corner & 4) ? step[2] : 0)));
      if (head != nullptr) best = nearest_in(*head, l.at, enough, best);
    }
    return best;
  }

  static constexpr int kPiece = 2;          // log2 of a piece's side in cells
  static constexpr double kCheaper = 0.25;  // a point beyond these few costs little in its piece

  /// Points of one cell or piece, of those that something stored may stand for.
  struct Group {
    double sum = 0;
    std::vector<std::uint32_t> points;
  };
  struct Choice {
    std::vector<std::uint32_t> added;
    double sum = 0;  ///< squares of the others
    double cost = 0;
  };

  [[nodiscard]] static bool is_reached(float square) { return square <= float(kReach * kReach); }
  /// What n points of one piece take to code, about.
  [[nodiscard]] static double cost_of(double n) { return n / (1 + kCheaper * n); }
  [[nodiscard]] std::uint64_t group_of(const Vec3& p, int shift) const {
    const Local l = local(p);
    return pack(l.cell[0] >> shift, l.cell[1] >> shift, l.cell[2] >> shift);
  }

  /// Groups are taken whole, the worst first: where surfaces are coded, a whole piece takes hardly more than
  /// a few of its points. Where all pieces are equally bad, cells are the better groups.
  [[nodiscard]] Novelty choose(const PointCloud& cloud, const std::vector<float>& squares,
                               double allowed) const {
    Choice best = take(cloud, squares, allowed, kPiece);
    Choice fine = take(cloud, squares, allowed, 0);
    if (fine.cost < best.cost) best = std::move(fine);
    Novelty r;
    r.squared_m2 = std::max(0.0, best.sum) * rms_m_ * rms_m_;
    r.added = std::move(best.added);
    return r;
  }

  [[nodiscard]] Choice take(const PointCloud& cloud, const std::vector<float>& squares, double allowed,
                            int shift) const {
    Choice r;
    std::size_t known = 0;
    for (std::uint32_t i = 0; i < squares.size(); ++i) {
      if (!is_reached(squares[i])) r.added.push_back(i);
      r.sum += is_reached(squares[i]) ? squares[i] : 0;
      known += is_reached(squares[i]);
    }
    if (r.sum <= allowed * static_cast<double>(known)) return r;
    for (const Group& group : worst_first(cloud, squares, allowed, shift)) {
      if (r.sum <= allowed * static_cast<double>(known)) break;
      r.sum -= group.sum;
      known -= group.points.size();
      r.added.insert(r.added.end(), group.points.begin(), group.points.end());
    }
    if (known == 0) r.sum = 0;
    std::sort(r.added.begin(), r.added.end());
    KeyTable<std::uint32_t> pieces;
    for (const std::uint32_t i : r.added) {
      std::uint32_t& n = pieces.at(group_of(cloud.xyz[i], kPiece));
      r.cost += cost_of(n + 1) - cost_of(n);
      ++n;
    }
    return r;
  }

  [[nodiscard]] std::vector<Group> worst_first(const PointCloud& cloud, const std::vector<float>& squares,
                                               double allowed, int shift) const {
    KeyTable<std::uint32_t> numbers;  // 1 + index of the group
    std::vector<Group> groups;
    for (std::uint32_t i = 0; i < squares.size(); ++i) {
      if (!is_reached(squares[i])) continue;
      std::uint32_t& number = numbers.at(group_of(cloud.xyz[i], shift));
      if (number == 0) {
        groups.emplace_back();
        number = static_cast<std::uint32_t>(groups.size());
      }
      groups[number - 1].sum += squares[i];
      groups[number - 1].points.push_back(i);
    }
    // What a group goes beyond the promise, for what it costs.
    const auto gain = [&](const Group& g) {
      const auto n = static_cast<double>(g.points.size());
      return (g.sum - allowed * n) / cost_of(n);
    };
    std::stable_sort(groups.begin(), groups.end(),
                     [&](const Group& a, const Group& b) { return gain(a) > gain(b); });
    return groups;
  }

  double rms_m_, side_m_;
  bool has_lasting_ = false;  // points that no folding will move
  Vec3 origin_;
  KeyTable<Head> cells_;
  std::vector<Point> points_;
};

/// Cells of the lattice, each with its number of points.
class CellCounts final : public StoredPoints {
 public:
  explicit CellCounts(const MapSchema& schema)
      : lattice_{schema.origin, schema.step_m, schema.coordinates.kind} {}

  void add(const PointCloud& cloud, bool) override {
    const std::vector<std::uint64_t> keys = keys_of(cloud);
    counts_.reserve(cloud.size());
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (i + kAhead < keys.size()) counts_.prefetch(keys[i + kAhead]);
      ++counts_.at(keys[i]);
    }
  }
  Novelty look(const PointCloud& cloud, double, double) const override {
    const std::vector<std::uint64_t> keys = keys_of(cloud);
    KeyTable<std::uint32_t> seen;  // of cells that are known
    seen.reserve(cloud.size() / 4);
    Novelty r;
    for (std::uint32_t i = 0; i < keys.size(); ++i) {
      if (i + kAhead < keys.size()) counts_.prefetch(keys[i + kAhead]);
      const std::uint32_t* stored = counts_.find(keys[i]);
      if (stored == nullptr || ++seen.at(keys[i]) > *stored) r.added.push_back(i);
    }
    return r;
  }
  [[nodiscard]] std::size_t bytes() const override { return counts_.bytes(); }

 private:
  static constexpr std::size_t kAhead = 12;  // the table is far larger than any cache

  [[nodiscard]] std::vector<std::uint64_t> keys_of(const PointCloud& cloud) const {
    std::vector<std::uint64_t> keys;
    keys.reserve(cloud.size());
    for (const Vec3& p : cloud.xyz)
      keys.push_back(pack(lattice_.lattice(p[0], 0), lattice_.lattice(p[1], 1), lattice_.lattice(p[2], 2)));
    return keys;
  }
  Quantizer lattice_;
  KeyTable<std::uint32_t> counts_;
};

/// Points bit for bit. Two hashes of 64 bits: one to find, one to be sure.
class EqualPoints final : public StoredPoints {
 public:
  void add(const PointCloud& cloud, bool) override {
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const auto [first, second] = hash(cloud, i);
      Known& k = known_.at(first);
      if (k.count == 0) k.second = second;
      k.count += k.second == second;
    }
  }
  Novelty look(const PointCloud& cloud, double, double) const override {
    KeyTable<std::uint32_t> seen;
    Novelty r;
    for (std::uint32_t i = 0; i < cloud.size(); ++i) {
      const auto [first, second] = hash(cloud, i);
      const Known* k = known_.find(first);
      const std::uint32_t stored = k != nullptr && k->second == second ? k->count : 0;
      if (++seen.at(first) > stored) r.added.push_back(i);
    }
    return r;
  }
  [[nodiscard]] std::size_t bytes() const override { return known_.bytes(); }

 private:
  struct Known {
    std::uint64_t second = 0;
    std::uint32_t count = 0;
  };
  static std::pair<std::uint64_t, std::uint64_t> hash(const PointCloud& cloud, std::size_t i) {
    std::uint64_t a = 0x9E3779B97F4A7C15u, b = 0xC2B2AE3D27D4EB4Fu;
    const auto take = [&](std::uint64_t v) {
      a = mix(a ^ v);
      b = mix(b + v * 0x165667B19E3779F9u);
    };
    for (const double x : cloud.xyz[i]) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &x, sizeof bits);
      take(bits);
    }
    for (const Channel& c : cloud.channels) {
      for (std::size_t k = 0; k < c.info.stride(); ++k) take(c.at(i)[k]);
    }
    return {a, b};
  }
  KeyTable<Known> known_;
};

}  // namespace

double farthest_known(const MapSchema& schema) {
  switch (schema.promise) {
    case PromiseKind::rms:
      return kReach * schema.promise_value;
    case PromiseKind::max_error:
      return schema.promise_value;
    case PromiseKind::lossless:
      return 0;
    case PromiseKind::paper:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

std::unique_ptr<StoredPoints> make_stored_points(const MapSchema& schema, const Vec3& origin) {
  switch (schema.promise) {
    case PromiseKind::rms:
      return std::make_unique<NearStored>(schema.promise_value, origin);
    case PromiseKind::max_error:
      return std::make_unique<CellCounts>(schema);
    case PromiseKind::lossless:
      return std::make_unique<EqualPoints>();
    case PromiseKind::paper:
      break;
  }
  return nullptr;
}

}  // namespace mapcodec
