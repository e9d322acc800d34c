// SPDX-License-Identifier: GPL-3.0-or-later
// Byte 0 chooses where poses come from; then a bag.
#include "slam_adapter/rosbag/bag_scans.hpp"
#include "tests/fuzz/formats_fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  if (size == 0) return 0;
  ReadOptions options;
  options.bag.poses = static_cast<BagOptions::Poses>(data[0] % 4);
  auto source = open_bag(memory_stream(ByteSpan(data + 1, size - 1)), "bag", options);
  if (source.ok()) drain(**source);
  return 0;
}
