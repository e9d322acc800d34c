// SPDX-License-Identifier: GPL-3.0-or-later
// Files of the outside world that are too large to lie here as bytes: made by the writers of the unit tests.
#include "tests/fuzz/file_seeds.hpp"

#include "tests/unit/e57_support.hpp"
#include "tests/unit/laz_support.hpp"
#include "tests/unit/rosbag_support.hpp"

namespace mapcodec::fuzz {
namespace {

void write(SeedFolder& folder, const std::string& target, const std::string& bytes) {
  folder.write(target, ByteSpan(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
}

void laz(SeedFolder& folder) {
  for (const std::size_t extra : {0u, 2u}) {
    auto pointwise = laz_test::pointwise_file(extra);
    pointwise.chunks = {{40, laz_test::pointwise_chunk(laz_test::rows(3, 40, extra, 1))},
                        {20, laz_test::pointwise_chunk(laz_test::rows(3, 20, extra, 2))}};
    write(folder, "formats_laz", laz_test::write_laz(pointwise));
    auto layered = laz_test::layered_file(extra);
    layered.chunks = {{40, laz_test::layered_chunk(laz_test::rows(7, 40, extra, 3))},
                      {20, laz_test::layered_chunk(laz_test::rows(7, 20, extra, 4))}};
    write(folder, "formats_laz", laz_test::write_laz(layered));
  }
}

void e57(SeedFolder& folder) {
  auto moved = e57_test::colored_scan(10);
  moved.pose = "<pose><rotation><w>1</w></rotation><translation><x>10</x></translation></pose>";
  for (const auto& scans :
       {std::vector{e57_test::colored_scan(30)}, std::vector{e57_test::colored_scan(5), moved}}) {
    const std::string file = e57_test::write_e57(scans, 2);
    std::string logical;
    for (std::size_t at = 0; at < file.size(); at += 1024) logical += file.substr(at, 1020);
    write(folder, "formats_e57", logical);
  }
}

void rosbag(SeedFolder& folder) {
  for (const char* compression : {"none", "lz4", "bz2"}) {
    for (const char poses : {0, 2})
      write(folder, "rosbag", std::string(1, poses) + rosbag_test::driving_bag(compression));
  }
  write(folder, "rosbag", std::string(1, '\0') + rosbag_test::driving_bag("none", false));
}

}  // namespace

void file_seeds(SeedFolder& folder) {
  laz(folder);
  e57(folder);
  rosbag(folder);
  write(folder, "autoware",
        "x_resolution: 20.0\ny_resolution: 20.0\nA.pcd: [1200, 2500]\n\"B.pcd\": [-1300, 0.5] # b\n");
}

}  // namespace mapcodec::fuzz
