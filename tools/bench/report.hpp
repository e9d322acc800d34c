// SPDX-License-Identifier: GPL-3.0-or-later
// Files of the report folder.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "tools/bench/bench.hpp"
#include "tools/bench/machine.hpp"
#include "tools/bench/plot.hpp"

namespace mapcodec::bench {

[[nodiscard]] Status write_text(const std::string& path, const std::string& text);

/// Collects what a bench finds and writes it.
class Report {
 public:
  /// @param name  "rate": rate.json, rate.md, rate_*.png.
  Report(const BenchSettings& settings, std::string name, int threads);

  /// Makes the folder. Errors: CannotWrite.
  [[nodiscard]] Status begin() const;
  [[nodiscard]] Json& json() { return json_; }
  /// Appends a line to the markdown.
  void line(const std::string& text) { markdown_ += text + "\n"; }
  void row(const std::vector<std::string>& cells);
  void table(const std::vector<std::string>& head);
  /// Draws plots to <name>_<suffix>.png (<name>.png if suffix is empty); where gnuplot is missing, a note
  /// says so.
  [[nodiscard]] Status plot(const std::vector<Plot>& plots, const std::string& suffix);
  /// Something a reader should know; once each.
  void note(const std::string& text);
  [[nodiscard]] Status finish();
  [[nodiscard]] std::string scratch() const { return folder_ + "/scratch.mapc"; }

 private:
  std::string folder_, name_, markdown_;
  Json json_;
};

/// `value` with `digits` significant digits, "-" if it is not finite.
[[nodiscard]] std::string digits(double value, int digits = 3);

}  // namespace mapcodec::bench
