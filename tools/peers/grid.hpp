// SPDX-License-Identifier: GPL-3.0-or-later
// The integer grid that peers without one of their own are given, and a clock.
#pragma once

#include <ctime>

#include "mapcodec/geometry/voxel.hpp"
#include "tools/peers/peers.hpp"

namespace mapcodec::peers {

/// Cells of `step_m` counted from the cloud's smallest corner: each point moves at most half a step along
/// each axis.
struct Grid {
  Vec3 corner{0, 0, 0};
  double step_m = 1;
  std::vector<VoxelCoord> cells;  ///< of each point, below 2^21

  [[nodiscard]] Vec3 centre(const VoxelCoord& cell) const;
};
/// Errors: InvalidArgument (more than 2^21 cells a side).
[[nodiscard]] Result<Grid> make_grid(const std::vector<Vec3>& points, double step_m);

/// Seconds since it was made: wall time, or the calling thread's processor time, which other processes do not
/// stretch.
class StopWatch {
 public:
  enum class Kind { wall, processor, whole_process };
  explicit StopWatch(Kind kind = Kind::processor)
      : clock_(kind == Kind::wall        ? CLOCK_MONOTONIC
               : kind == Kind::processor ? CLOCK_THREAD_CPUTIME_ID
                                         : CLOCK_PROCESS_CPUTIME_ID),
        begin_(now()) {}
  [[nodiscard]] double seconds() const { return now() - begin_; }

 private:
  [[nodiscard]] double now() const {
    timespec t{};
    clock_gettime(clock_, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }
  clockid_t clock_;
  double begin_;
};

}  // namespace mapcodec::peers
