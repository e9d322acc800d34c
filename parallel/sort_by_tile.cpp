// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/sort_by_tile.hpp"

#include <algorithm>
#include <atomic>
#include <memory>
#include <numeric>

namespace mapcodec {
namespace {

constexpr std::size_t kPiecePoints = std::size_t{1} << 17;

/// What one piece of the points holds, in its own numbers.
struct Piece {
  std::vector<TileKey> keys;
  std::vector<std::uint32_t> counts;  // then: where the next point of that tile goes
};

class TileSort {
 public:
  TileSort(const std::vector<Vec3>& points, const TilePlan& plan, Runner& runner)
      : points_(points),
        plan_(plan),
        runner_(runner),
        pieces_((points.size() + kPiecePoints - 1) / kPiecePoints) {
    // Not a vector: it would fill the memory with zeros on one thread first.
    tile_ = std::make_unique_for_overwrite<std::uint32_t[]>(points.size());
    result_.order.resize(points.size());
  }

  Result<TileOrder> run() {
    for_each_piece([this](std::size_t k) { locate(k); });
    if (lost_)
      return make_error(ErrorCode::kMalformed, "the source gave other points when it was read again");
    number_tiles();
    for_each_piece([this](std::size_t k) { place(k); });
    return std::move(result_);
  }

 private:
  template <class F>
  void for_each_piece(const F& f) {
    runner_.run(pieces_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) f(k);
    });
  }
  [[nodiscard]] std::size_t end_of(std::size_t k) const {
    return std::min(points_.size(), (k + 1) * kPiecePoints);
  }

  void locate(std::size_t k) {
    TileLocator locator(plan_);
    Piece& piece = pieces_[k];
    piece.counts.resize(locator.keys().size());
    for (std::size_t i = k * kPiecePoints; i < end_of(k); ++i) {
      const std::uint32_t t = locator.locate(points_[i]);
      if (t == KeyIndex::kNone) {
        lost_.store(true, std::memory_order_relaxed);
        return;
      }
      if (t >= piece.counts.size()) piece.counts.resize(t + 1);
      ++piece.counts[t];
      tile_[i] = t;
    }
    piece.keys = locator.keys();
  }

  void number_tiles();
  void place(std::size_t k) {
    std::vector<std::uint32_t>& next = pieces_[k].counts;
    for (std::size_t i = k * kPiecePoints; i < end_of(k); ++i) {
      result_.order[next[tile_[i]]++] = static_cast<std::uint32_t>(i);
    }
  }

  const std::vector<Vec3>& points_;
  const TilePlan& plan_;
  Runner& runner_;
  std::vector<Piece> pieces_;
  std::unique_ptr<std::uint32_t[]> tile_;  // of each point, in its piece's numbers
  std::atomic<bool> lost_{false};
  TileOrder result_;
};

/// Turns the pieces' counts into the places of their first points.
void TileSort::number_tiles() {
  KeyIndex index;
  std::vector<std::uint32_t> totals;
  for (const Piece& piece : pieces_) {
    for (std::size_t t = 0; t < piece.counts.size(); ++t) {
      if (piece.counts[t] == 0) continue;
      const std::uint32_t n = index.add(piece.keys[t]);
      totals.resize(index.keys().size());
      totals[n] += piece.counts[t];
    }
  }
  std::vector<std::uint32_t> by_key(totals.size());
  std::iota(by_key.begin(), by_key.end(), 0u);
  std::sort(by_key.begin(), by_key.end(), [&](std::uint32_t a, std::uint32_t b) {
    return compare_morton(index.keys()[a], index.keys()[b]) < 0;
  });
  std::uint32_t at = 0;
  std::vector<std::uint32_t> next(totals.size());
  for (const std::uint32_t n : by_key) {
    next[n] = at;
    result_.runs.push_back({index.keys()[n], at, at + totals[n]});
    at += totals[n];
  }
  for (Piece& piece : pieces_) {
    for (std::size_t t = 0; t < piece.counts.size(); ++t) {
      if (piece.counts[t] == 0) continue;
      std::uint32_t& place = next[index.find(piece.keys[t])];
      place += std::exchange(piece.counts[t], place);
    }
  }
}

}  // namespace

Result<TileOrder> sort_by_tile(const std::vector<Vec3>& points, const TilePlan& plan, Runner& runner) {
  return TileSort(points, plan, runner).run();
}

}  // namespace mapcodec
