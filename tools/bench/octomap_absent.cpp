// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/bench.hpp"

namespace mapcodec {

Status bench_octomap(const BenchSettings&) {
  return make_error(ErrorCode::kUnsupported, "this build has no OctoMap");
}

}  // namespace mapcodec
