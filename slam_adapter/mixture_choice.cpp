// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mixture_choice.hpp"

#include <algorithm>
#include <cmath>

namespace mapcodec {
namespace {

using Choice = std::vector<std::size_t>;

bool fits(const MixtureLimit& lost, const MixtureLimit& limit) {
  return lost.forward <= limit.forward && lost.backward <= limit.backward;
}

/// Prices between which all choices lie: below the one errors decide alone, above the other bits.
struct Prices {
  double low = INFINITY, high = 0;
};
Prices prices_of(std::span<const Codings> tiles) {
  double least_error = INFINITY, most_error = 0, most_bits = 1;
  for (const Codings& codings : tiles) {
    for (const CodingFigures& c : codings) {
      if (!std::isfinite(c.bits)) continue;
      const double error = c.forward + c.backward;
      if (error > 0) least_error = std::min(least_error, error);
      most_error = std::max(most_error, error);
      most_bits = std::max(most_bits, c.bits);
    }
  }
  return {least_error / most_bits / 16, std::max(16 * most_error, 1.0)};
}

/// Another coding for a tile, and the bits that it saves.
struct Change {
  std::size_t tile, coding;
  double saved;
};

/// Takes what still fits, what saves most first.
void fill_up(std::span<const Codings> tiles, const MixtureLimit& limit, Choice& choice) {
  std::vector<Change> changes;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    for (std::size_t k = 0; k < tiles[i].size(); ++k) {
      const double saved = tiles[i][choice[i]].bits - tiles[i][k].bits;
      if (saved > 0) changes.push_back({i, k, saved});
    }
  }
  std::stable_sort(changes.begin(), changes.end(),
                   [](const Change& a, const Change& b) { return a.saved > b.saved; });
  MixtureLimit lost = lost_by(tiles, choice);
  for (const Change& c : changes) {
    const CodingFigures &now = tiles[c.tile][choice[c.tile]], &other = tiles[c.tile][c.coding];
    const MixtureLimit after{lost.forward - now.forward + other.forward,
                             lost.backward - now.backward + other.backward};
    if (other.bits >= now.bits || !fits(after, limit)) continue;
    choice[c.tile] = c.coding;
    lost = after;
  }
}

}  // namespace

Choice mixture_at(std::span<const Codings> tiles, double bit_price) {
  Choice choice(tiles.size());
  const auto cost = [&](const CodingFigures& c) { return (c.forward + c.backward) / 2 + bit_price * c.bits; };
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const auto best = std::min_element(tiles[i].begin(), tiles[i].end(),
                                       [&](const auto& a, const auto& b) { return cost(a) < cost(b); });
    choice[i] = static_cast<std::size_t>(best - tiles[i].begin());
  }
  return choice;
}

MixtureLimit lost_by(std::span<const Codings> tiles, std::span<const std::size_t> choice) {
  MixtureLimit sum;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    sum.forward += tiles[i][choice[i]].forward;
    sum.backward += tiles[i][choice[i]].backward;
  }
  return sum;
}

std::optional<Choice> cheapest_within(std::span<const Codings> tiles, const MixtureLimit& limit) {
  auto [low, high] = prices_of(tiles);
  if (!(low < high)) low = high / 2;  // nothing loses anything
  std::optional<Choice> best;
  const auto try_price = [&](double price) {
    Choice choice = mixture_at(tiles, price);
    const bool within = fits(lost_by(tiles, choice), limit);
    if (within) best = std::move(choice);
    return within;
  };
  if (try_price(high)) return best;
  if (!try_price(low)) return std::nullopt;
  constexpr double kCloseEnough = 1.001;
  while (high / low > kCloseEnough) {
    const double middle = std::sqrt(low * high);
    (try_price(middle) ? low : high) = middle;
  }
  fill_up(tiles, limit, *best);
  return best;
}

}  // namespace mapcodec
