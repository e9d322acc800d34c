// SPDX-License-Identifier: GPL-3.0-or-later
// What a map that lives has spent of its rms promise, and what is left for folding.
#pragma once

#include <cstdint>
#include <optional>

#include "maps/map_types.hpp"

namespace mapcodec {

/// Key in MapInfo::extras of rms maps with pending segments: f64 root mean square distance of the points that
/// came in to the stored ones, f64 of the stored ones to those, varint number of pending points.
inline constexpr const char* kRmsAccountExtra = "rms_account";

/// Squared distances of a map, both directions apart: folding moves stored points, but of those that came in
/// only the ones that pending points stand for. Sums of independent errors; every figure is an upper bound
/// but for that. Threads: one at a time.
class RmsAccount {
 public:
  /// Points of one batch or tile.
  struct Entry {
    double added = 0, known = 0;           ///< points that became stored ones; others
    double known_m2 = 0;                   ///< squared distances of the others
    double forward_m = 0, backward_m = 0;  ///< root mean squares of coding what was added
    bool pending = false;                  ///< folding what was added is yet to come
  };

  RmsAccount() = default;
  /// @param promise_m  0: the map promises no rms, and nothing is counted. @param stored  points.
  RmsAccount(const MapInfo& info, double promise_m, double stored);

  void add(const Entry& e);
  /// What goes beyond the promise for all that came in, pending points folded; not above 0: nothing [m^2].
  /// @param known, known_m2  of points yet to be added.
  [[nodiscard]] double excess_m2(double known, double known_m2) const;
  /// Root mean square error that folding may add to pending points, so that the map's promise holds [m].
  [[nodiscard]] double folding_rms_m() const;
  /// Pending points that were coded for good.
  void fold(double points, double forward_m, double backward_m);
  /// No pending segment is left.
  void all_folded() { pending_ = 0; }
  /// Of the map: the larger direction [m].
  [[nodiscard]] double rms_m() const;
  /// For the next revision; nothing where rms_m() says it all.
  [[nodiscard]] std::optional<Bytes> extra() const;

 private:
  void read(ByteSpan extra, double achieved_m);

  double promise_m_ = 0;
  double came_ = 0, stored_ = 0, pending_ = 0;  // points
  double forward_m2_ = 0, backward_m2_ = 0;     // sums
};

}  // namespace mapcodec
