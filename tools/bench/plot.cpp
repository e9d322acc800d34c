// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/plot.hpp"

#include <spawn.h>
#include <sys/wait.h>

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
    // Titles are shown as they are: gnuplot would lower what follows an underscore.
    r += c == '_' ? '-' : c;
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

void write_command(const Plot& plot, std::size_t number, std::ostream& out) {
  out << "set title " << quoted(plot.title) << "\nset xlabel " << quoted(plot.x_label) << "\nset ylabel "
      << quoted(plot.y_label) << "\nunset logscale\n";
  if (plot.log_x) out << "set logscale x\n";
  if (plot.log_y) out << "set logscale y\n";
  std::string separator = "plot ";
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const Series& s = plot.series[i];
    if (!has_data(plot, s)) continue;
    out << separator << "$p" << number << "s" << i << " using 1:2 with "
        << (s.line ? "linespoints" : "points") << " lw 2 pt " << i % 13 + 4 << " ps 1.2 title "
        << quoted(s.title);
    separator = ", \\\n     ";
  }
  out << "\n";
}

std::string script(const std::vector<Plot>& plots, const std::string& png_path) {
  std::ostringstream out;
  out << "set terminal pngcairo size " << 1000 * plots.size() << ",640 font \"Sans,12\"\nset output "
      << "\"" << png_path << "\"\nset grid\nset key outside right top vertical\n";
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
