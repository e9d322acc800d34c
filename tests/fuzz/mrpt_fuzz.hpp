// SPDX-License-Identifier: GPL-3.0-or-later
// MRPT's files through the door that the program uses: a child that MRPT may break, and a parent that must
// not. The child is forked here instead of started anew, which takes too long.
#pragma once

#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "slam_adapter/mrpt/reader_process.hpp"
#include "slam_adapter/mrpt/serve.hpp"

namespace mapcodec::fuzz {

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kSanitized = true;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif
#else
constexpr bool kSanitized = false;
#endif

/// As the reading program, but for the sanitizer's own address space.
[[noreturn]] inline void be_the_reader(const std::string& path, int fd) {
  if (!kSanitized) (void)limit_process(std::uint64_t{3} << 30);
  ::alarm(100);
  ::close(STDERR_FILENO);
  serve_log(path, {}, fd);
  ::_exit(0);
}

/// As RawlogReader: every message is looked at.
inline void be_the_asker(MessagePipe pipe) {
  for (;;) {
    const auto m = pipe.read();
    if (!m.ok()) return;
    if (m->kind == WireKind::frame) {
      const auto frame = read_frame(m->payload);
      if (!frame.ok()) std::abort();  // our own reader wrote it
    } else if (m->kind == WireKind::error) {
      const Error error = read_error(m->payload);
      if (error.message.empty()) std::abort();
      return;
    } else {
      if (!read_summary(m->payload).ok()) std::abort();
      return;
    }
  }
}

inline int run(const std::uint8_t* data, std::size_t size, const char* name) {
  const int file = ::memfd_create(name, 0);
  if (file < 0 || ::write(file, data, size) != static_cast<ssize_t>(size)) return 0;
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) std::abort();
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    be_the_reader("/proc/self/fd/" + std::to_string(file), ends[1]);
  }
  ::close(ends[1]);
  be_the_asker(MessagePipe(ends[0], -1, child));
  ::close(file);
  return 0;
}

}  // namespace mapcodec::fuzz
