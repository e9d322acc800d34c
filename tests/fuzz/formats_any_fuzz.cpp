// SPDX-License-Identifier: GPL-3.0-or-later
// Recognition by content, with a name that decides nothing but KITTI.
#include "tests/fuzz/formats_fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return mapcodec::fuzz_bytes(data, size, "input.bin");
}
