// SPDX-License-Identifier: GPL-3.0-or-later
// Points in blocks: how a map of any size passes through bounded memory.
#pragma once

#include <cstddef>
#include <optional>

#include "mapcodec/base/result.hpp"
#include "mapcodec/cloud/point_cloud.hpp"

namespace mapcodec {

/// Where points come from. One thread at a time.
class PointSource {
 public:
  virtual ~PointSource() = default;

  /// Format and channels of every block, known after opening; holds no point.
  [[nodiscard]] virtual const PointCloud& layout() const = 0;
  /// Points as the source announces them (before NaN are dropped), if it does.
  [[nodiscard]] virtual std::optional<std::uint64_t> announced_points() const = 0;
  /// Replaces `block` by the next points, at most about 65,536; false at the end (then `block` is empty).
  /// An error stays: the next call returns it again.
  virtual Result<bool> next(PointCloud& block) = 0;
  /// Starts over from the first point.
  virtual Status rewind() = 0;
  /// Points left out so far because a coordinate was NaN or infinite (0 where the reader was told to keep
  /// them).
  [[nodiscard]] virtual std::uint64_t dropped_points() const = 0;
  /// Things a user should hear (each once), such as "float32 cannot hold millimetres at 1e6 m".
  [[nodiscard]] virtual std::vector<std::string> warnings() const { return {}; }
};

/// Where points go. One thread at a time.
class PointSink {
 public:
  virtual ~PointSink() = default;
  /// Appends `block`, laid out as the sink was opened with.
  virtual Status write(const PointCloud& block) = 0;
  /// Completes the output (counts, headers, fsync, rename). Without it the output is removed.
  virtual Status finish() = 0;
};

}  // namespace mapcodec
