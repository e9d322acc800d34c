// SPDX-License-Identifier: GPL-3.0-or-later
// The input is a file without the checksums of its pages, which are put in here: no fuzzer would find them.
#include "slam_adapter/e57/e57.hpp"
#include "tests/fuzz/formats_fuzz.hpp"
#include "tests/unit/e57_support.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace mapcodec;
  const std::string file = e57_test::paged(std::string(reinterpret_cast<const char*>(data), size));
  auto stream = memory_stream(ByteSpan(reinterpret_cast<const std::uint8_t*>(file.data()), file.size()));
  auto reader = open_e57(*stream);
  if (reader.ok()) drain(*make_source(std::move(stream), std::move(reader).value(), "e57", {}));
  return 0;
}
