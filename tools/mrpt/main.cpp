// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodec-mrpt: reads and writes MRPT's files for mapcodec, which starts it and talks with it over a socket
// on its standard input and output. Not for people: use `mapcodec compress`, `rawlog`, `decompress`.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "slam_adapter/mrpt/serve.hpp"

namespace {

using mapcodec::LogSettings;

struct Arguments {
  std::string verb, path;
  LogSettings log;
  std::uint32_t keyframes = 0;
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;
};

std::uint64_t number(const std::string& text) {
  return std::strtoull(text.c_str(), nullptr, 10);
}

bool parse(const std::vector<std::string>& words, Arguments& a) {
  if (words.size() < 2) return false;
  a.verb = words[0];
  a.path = words[1];
  for (std::size_t i = 2; i < words.size(); ++i) {
    const std::string& w = words[i];
    if (w == "--list") {
      a.log.list = true;
    } else if (w == "--match-scans") {
      a.log.match_scans = true;
    } else if (i + 1 == words.size()) {
      return false;
    } else if (w == "--sensor") {
      a.log.sensors.insert(words[++i]);
    } else if (w == "--skip") {
      a.log.skip = number(words[++i]);
    } else if (w == "--decimation") {
      a.log.decimation = static_cast<std::uint8_t>(number(words[++i]));
    } else if (w == "--keyframes") {
      a.keyframes = static_cast<std::uint32_t>(number(words[++i]));
    } else if (w == "--memory") {
      a.memory_bytes = number(words[++i]);
    } else {
      return false;
    }
  }
  return a.verb == "read" || a.verb == "write";
}

/// What MRPT prints must not come between our messages.
int take_over_output() {
  const int fd = ::dup(STDOUT_FILENO);
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  return fd;
}

}  // namespace

int main(int argc, char** argv) {
  Arguments a;
  if (!parse({argv + 1, argv + argc}, a)) {
    std::fprintf(stderr, "mapcodec-mrpt: a part of mapcodec, which starts it\n");
    return 2;
  }
  if (const auto s = mapcodec::limit_process(a.memory_bytes); !s.ok()) return 1;
  const int fd = take_over_output();
  if (a.verb == "read") {
    mapcodec::serve_log(a.path, a.log, fd);
  } else {
    mapcodec::serve_simplemap(a.path, a.keyframes, fd);
  }
  // Without the destructors of MRPT's and OpenCV's globals, which hostile bytes may have reached.
  ::_exit(0);
}
