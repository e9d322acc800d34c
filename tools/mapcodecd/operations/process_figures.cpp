// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/process_figures.hpp"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>

namespace mapcodec::daemon {
namespace {

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

/// What the program holds; the rest of the resident heap was freed and is kept for the next who asks.
double allocated_bytes() {
  const struct mallinfo2 heap = ::mallinfo2();
  return static_cast<double>(heap.uordblks) + static_cast<double>(heap.hblkhd);
}

double processor_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double open_files() {
  std::error_code error;
  double count = 0;
  for (auto at = std::filesystem::directory_iterator("/proc/self/fd", error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error))
    ++count;
  return count;
}

double most_files() {
  rlimit limit{};
  getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<double>(limit.rlim_cur);
}

}  // namespace

std::vector<GaugeSample> process_figures() {
  static const auto start = static_cast<double>(std::time(nullptr));  // of the first scrape or of main
  return {
      {"process_resident_memory_bytes", "Resident memory.", resident_bytes()},
      {"mapcodec_allocated_bytes", "Memory in use, without what is free within the heap.", allocated_bytes()},
      {"process_cpu_seconds_total", "Processor time.", processor_seconds(), true},
      {"process_open_fds", "Open files.", open_files()},
      {"process_max_fds", "Files that may be open.", most_files()},
      {"process_start_time_seconds", "Start of the process, since 1970.", start}};
}

}  // namespace mapcodec::daemon
