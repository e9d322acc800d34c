// SPDX-License-Identifier: GPL-3.0-or-later
// The parts of bench_update.
#pragma once

#include "tools/bench/report.hpp"

namespace mapcodec::bench {

/// Points into a large map while another process-like reader decodes its tiles.
[[nodiscard]] Status measure_ingest(const BenchSettings& settings, Report& report);

/// One place that is scanned again and again, until its tiles are split.
[[nodiscard]] Status measure_growth(const BenchSettings& settings, Report& report);

/// `p` of 0..1 of values that are sorted here; 0 of none.
[[nodiscard]] double quantile(std::vector<double> values, double p);

}  // namespace mapcodec::bench
