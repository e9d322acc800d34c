// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/attribute/lattice_search.hpp"

namespace mapcodec {
namespace {

/// Whether every `stride`-th value is on the lattice, up to `allowed` exceptions.
bool holds(const ValueLattice& lattice, std::span<const double> values, std::size_t stride,
           std::size_t allowed) {
  std::size_t missed = 0;
  for (std::size_t i = 0; i < values.size(); i += stride) {
    if (!lattice.exactly(values[i]) && ++missed > allowed) return false;
  }
  return true;
}

/// The coarsest lattice of one family.
std::optional<ValueLattice> search(LatticeKind kind, int first, int last, std::span<const double> values,
                                   bool single, double share) {
  const std::size_t stride = values.size() / 256 + 1;
  const auto allowed = [&](std::size_t count) {
    return static_cast<std::size_t>(share * static_cast<double>(count));
  };
  ValueLattice lattice;
  lattice.kind = kind;
  lattice.single = single;
  for (int n = first; n <= last; ++n) {
    lattice.n = static_cast<std::uint8_t>(n);
    // The sample gets some slack: what is rare in all may be frequent in it.
    const std::size_t slack = share > 0 ? 3 + 2 * allowed(values.size() / stride) : 0;
    if (holds(lattice, values, stride, slack) && holds(lattice, values, 1, allowed(values.size())))
      return lattice;
  }
  return std::nullopt;
}

}  // namespace

std::optional<ValueLattice> find_lattice(std::span<const double> values, bool single, double share) {
  if (values.empty()) return std::nullopt;
  std::optional<ValueLattice> best = search(LatticeKind::binary, 0, 30, values, single, share);
  const auto consider = [&](const std::optional<ValueLattice>& found) {
    if (found && (!best || found->unit() > best->unit())) best = found;
  };
  consider(search(LatticeKind::decimal, 1, 9, values, single, share));
  if (single) consider(search(LatticeKind::product, 1, 6, values, single, share));
  return best;
}

}  // namespace mapcodec
