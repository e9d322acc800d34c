// SPDX-License-Identifier: GPL-3.0-or-later
// What the reader of MRPT's files answers, should hostile bytes have taken it over; and what a map says of an
// interrupted run.
#include "slam_adapter/mrpt/frame_wire.hpp"
#include "slam_adapter/mrpt/map_progress.hpp"
#include "slam_adapter/mrpt/pose_track.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mapcodec::ByteSpan bytes(data, size);
  (void)mapcodec::read_frame(bytes).ok();
  (void)mapcodec::read_summary(bytes).ok();
  (void)mapcodec::read_error(bytes).message;
  (void)mapcodec::read_progress(bytes).ok();
  (void)mapcodec::read_pose_text({reinterpret_cast<const char*>(data), size}, "poses").ok();
  return 0;
}
