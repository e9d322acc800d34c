// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/machine.hpp"

#include <spdlog/fmt/fmt.h>

#include <cstdlib>
#include <fstream>
#include <thread>

#include "tools/version.hpp"

namespace mapcodec::bench {
namespace {

std::string cpu_model() {
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    const std::size_t colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

/// How busy the machine is with other work: figures of wall time mean little above the number of cores.
double load_average() {
  double load[1] = {0};
  return getloadavg(load, 1) == 1 ? load[0] : 0;
}

}  // namespace

int usable_cores() {
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

Json machine_json(int threads) {
  return {{"cpu", cpu_model()},
          {"cores", usable_cores()},
          {"threads", threads},
          {"compiler", kCompiler},
          {"version", kVersion},
          {"commit", kCommit},
          {"load_average", load_average()}};
}

std::string machine_text(int threads) {
  return fmt::format(
      "{}, {} cores, {} threads, {}, mapcodec {} (commit {}), load average {:.1f} at the start", cpu_model(),
      usable_cores(), threads, kCompiler, kVersion, kCommit, load_average());
}

}  // namespace mapcodec::bench
