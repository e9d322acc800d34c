// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mapcodec/base/result.hpp"

namespace mapcodec::bench {

struct Series {
  std::string title;
  std::vector<std::pair<double, double>> points;
  bool line = true;  ///< false: marks alone
};

struct Plot {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Series> series;
};

/// Draws the plots side by side into a PNG by a gnuplot process; its script stays beside it (extension .gp).
/// Errors: CannotWrite; Unsupported (no gnuplot, or it failed: the script is there for later).
[[nodiscard]] Status write_plots(const std::vector<Plot>& plots, const std::string& png_path);

}  // namespace mapcodec::bench
