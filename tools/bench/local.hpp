// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of `bench local`.
#pragma once

#include "parallel/arena.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/clouds.hpp"
#include "tools/bench/report.hpp"

namespace mapcodec::bench {

/// What the parts share.
struct LocalBench {
  const BenchSettings& settings;
  Report& report;
  Arena& arena;

  void print(const std::string& text) {
    settings.print(text);
    report.line(text.empty() ? text : "    " + text);
  }
};

/// Scans that are not in the map, against the raw map's result. Errors: CannotWrite, those of the codec.
[[nodiscard]] Status bench_localisation(LocalBench& bench);

/// The first file below settings.data whose path ends with `part`. Errors: NotFound.
[[nodiscard]] Result<std::string> path_named(const BenchSettings& settings, const std::string& part);
/// Its points. Errors: NotFound, those of reading.
[[nodiscard]] Result<BenchCloud> load_named(const BenchSettings& settings, const std::string& part);
[[nodiscard]] double wall_s();
[[nodiscard]] std::uint64_t file_bytes(const std::string& path);

}  // namespace mapcodec::bench
