// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/plot.hpp"

#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "tools/bench/report.hpp"

extern char** environ;

namespace mapcodec::bench {
namespace {

std::string quoted(const std::string& text) {
  std::string r = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') r += '\\';
    r += c;
  }
  r += '"';
  return r;
}

bool is_drawable(const Plot& plot, double x, double y) {
  return std::isfinite(x) && std::isfinite(y) && (!plot.log_x || x > 0) && (!plot.log_y || y > 0);
}

void write_data(const Plot& plot, std::size_t number, std::ostream& out) {
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    out << "$p" << number << "s" << i << " << EOD\n";
    for (const auto& [x, y] : plot.series[i].points) {
      if (is_drawable(plot, x, y)) out << x << " " << y << "\n";
    }
    out << "EOD\n";
  }
}

bool has_data(const Plot& plot, const Series& s) {
  for (const auto& [x, y] : s.points) {
    if (is_drawable(plot, x, y)) return true;
  }
  return false;
}

/// A logarithmic axis that ends at the data, with marks at 1, 2, 5, 10, ...: gnuplot's own would run to the
/// next powers of ten and mark nothing between.
void write_log_axis(const Plot& plot, char axis, std::ostream& out) {
  double low = HUGE_VAL, high = 0;
  for (const Series& s : plot.series) {
    for (const auto& [x, y] : s.points) {
      if (!is_drawable(plot, x, y)) continue;
      low = std::min(low, axis == 'x' ? x : y);
      high = std::max(high, axis == 'x' ? x : y);
    }
  }
  if (!(low <= high)) return;
  constexpr double kRoom = 1.25;
  out << "set logscale " << axis << "\nset " << axis << "range [" << low / kRoom << ":" << high * kRoom
      << "]\n";
  const int first = static_cast<int>(std::floor(std::log10(low))),
            last = static_cast<int>(std::ceil(std::log10(high)));
  std::string separator = "set " + std::string(1, axis) + "tics (";
  for (int e = first; e <= last; ++e) {
    for (const int digit : {1, 2, 5}) {
      if (digit > 1 && last - first > 3) continue;
      out << separator << "\"" << digit * std::pow(10, e) << "\" " << digit << "e" << e;
      separator = ", ";
    }
  }
  out << ")\n";
}

// Gnuplot's own include a yellow that hardly shows on white.
constexpr const char* kColors[] = {"#6a3d9a", "#1b9e77", "#56b4e9", "#e69f00", "#a65628",
                                   "#0072b2", "#e41a1c", "#000000", "#f781bf"};

void write_command(const Plot& plot, std::size_t number, std::ostream& out) {
  out << "set title " << quoted(plot.title) << "\nset xlabel " << quoted(plot.x_label)
      << " offset 0,0.6\nset ylabel " << quoted(plot.y_label)
      << "\nunset logscale\nset autoscale\nset xtics auto\nset ytics auto\n";
  if (plot.log_x) write_log_axis(plot, 'x', out);
  if (plot.log_y) write_log_axis(plot, 'y', out);
  std::string separator = "plot ";
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& s = plot.series[i];
    if (!has_data(plot, s)) continue;
    out << separator << "$p" << number << "s" << i << " using 1:2 with "
        << (s.line ? "linespoints" : "points") << " lw 2 lc rgb \"" << kColors[i % std::size(kColors)]
        << "\" pt " << i % 13 + 4 << " ps 1.2 title " << quoted(s.title);
    separator = ", \\\n     ";
  }
  out << "\n";
}

std::string script(const std::vector<Plot>& plots, const std::string& png_path) {
  std::ostringstream out;
  out << "set terminal pngcairo noenhanced size " << 800 * plots.size()
      << ",640 font \"Sans,12\"\nset output "
      << "\"" << png_path << "\"\nset grid\nset key below horizontal maxrows 4\n";
  for (std::size_t i = 0; i < plots.size(); ++i) write_data(plots[i], i, out);
  out << "set multiplot layout 1," << plots.size() << "\n";
  for (std::size_t i = 0; i < plots.size(); ++i) write_command(plots[i], i, out);
  out << "unset multiplot\n";
  return out.str();
}

Status run_gnuplot(const std::string& script_path) {
  std::string program = "gnuplot", argument = script_path;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t pid = 0;
  if (posix_spawnp(&pid, "gnuplot", nullptr, nullptr, arguments, environ) != 0) {
    return make_error(ErrorCode::kUnsupported, "no plots: gnuplot is not installed");
  }
  int state = 0;
  if (waitpid(pid, &state, 0) == pid && WIFEXITED(state) && WEXITSTATUS(state) == 0) return {};
  return make_error(ErrorCode::kUnsupported, "gnuplot failed on " + script_path);
}

}  // namespace

Status write_plots(const std::vector<Plot>& plots, const std::string& png_path) {
  const std::string script_path = std::filesystem::path(png_path).replace_extension(".gp").string();
  MAPCODEC_TRY(write_text(script_path, script(plots, png_path)));
  return run_gnuplot(script_path);
}

}  // namespace mapcodec::bench
