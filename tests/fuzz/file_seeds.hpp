// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tests/fuzz/seeds.hpp"

namespace mapcodec::fuzz {

/// Seeds of formats_laz, formats_e57, rosbag and autoware.
void file_seeds(SeedFolder& folder);

}  // namespace mapcodec::fuzz
