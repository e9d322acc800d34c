// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/fuzz/mrpt_fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return mapcodec::fuzz::run(data, size, "simplemap");
}
