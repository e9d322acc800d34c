// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/laz.hpp"
#include "tests/fuzz/formats_fuzz.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  auto stream = memory_stream(ByteSpan(data, size));
  auto reader = open_laz(*stream);
  if (reader.ok()) drain(*make_source(std::move(stream), std::move(reader).value(), "laz", {}));
  return 0;
}
