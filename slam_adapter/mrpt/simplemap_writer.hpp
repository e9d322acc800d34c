// SPDX-License-Identifier: GPL-3.0-or-later
// Keyframes as MRPT's simplemap, one after the other: memory is bounded by one.
#pragma once

#include <memory>
#include <string>

#include "slam_adapter/mrpt/rawlog_frame.hpp"

namespace mapcodec {

/// A keyframe becomes a CPose3DPDFGaussian (no covariance) with a CSensoryFrame of one
/// CObservationPointCloud, in a coloured map where there is "rgb", in one with intensities where there is
/// "intensity" (of a number type; float32 in MRPT), else in a simple one. Threads: one at a time.
class SimplemapWriter {
 public:
  /// @param keyframes  how many will come. Errors: CannotWrite.
  [[nodiscard]] static Result<SimplemapWriter> create(const std::string& path, std::uint32_t keyframes);
  SimplemapWriter(SimplemapWriter&&) noexcept;
  ~SimplemapWriter();

  /// @param frame  with T_map_vehicle. Errors: CannotWrite.
  [[nodiscard]] Status add(const RawlogFrame& frame);
  /// Errors: CannotWrite; InvalidArgument (another number of keyframes than announced).
  [[nodiscard]] Status finish();

 private:
  struct State;
  explicit SimplemapWriter(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
