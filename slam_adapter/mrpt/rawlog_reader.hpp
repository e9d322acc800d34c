// SPDX-License-Identifier: GPL-3.0-or-later
// MRPT's rawlogs, simplemaps and serialised maps, an observation at a time.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "slam_adapter/mrpt/rawlog_frame.hpp"

namespace mapcodec {

struct RawlogOptions {
  std::vector<std::string> sensors;  ///< labels; empty: all
  std::uint64_t skip = 0;            ///< observations before this number are passed over
  std::uint8_t decimation = 1;       ///< of range images: one point of each block of this many pixels squared
  bool list = false;         ///< no points, only their channels; robot poses, too, as frames without channels
  bool match_scans = false;  ///< 2D scans get poses from MRPT's ICP
  /// Address space of the process that reads; it is about 1 GB with nothing read.
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;
};

/// Reads `.rawlog` (sensory frames and actions, or observations alone), `.simplemap` and serialised point
/// maps of MRPT up to 2.5.8, zipped or not; images stored beside a log are taken from its folder. Classes
/// that MRPT does not know are counted. A program of its own does it (mapcodec-mrpt): whatever the bytes are,
/// the worst is an error. Memory here: one observation. Threads: one at a time.
class RawlogReader {
 public:
  /// Errors, naming the file: NotFound, Unreadable, Empty, Unsupported (built without MRPT).
  [[nodiscard]] static Result<RawlogReader> open(const std::string& path, const RawlogOptions& options = {});
  RawlogReader(RawlogReader&&) noexcept;
  RawlogReader& operator=(RawlogReader&&) noexcept;
  ~RawlogReader();

  /// The next observation with points; nothing at the end. An error stays.
  /// Errors, naming the file: Truncated, Malformed, Unsupported (of a newer MRPT), LimitExceeded (an object
  /// that asks for too much memory; a reader that gives no answer for two minutes).
  [[nodiscard]] Result<std::optional<RawlogFrame>> next();
  /// What the log held; whole after `next` gave nothing.
  [[nodiscard]] const RawlogSummary& summary() const;
  [[nodiscard]] std::uint64_t file_bytes() const;

 private:
  struct State;
  explicit RawlogReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// One sentence for each class of which nothing was used: "12 CObservationGPS: holds no points".
[[nodiscard]] std::vector<std::string> unused_classes(const RawlogSummary& summary);

}  // namespace mapcodec
