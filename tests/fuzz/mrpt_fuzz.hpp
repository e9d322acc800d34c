// SPDX-License-Identifier: GPL-3.0-or-later
// MRPT's files through the door that the program uses: a child that MRPT may break, and a parent that must
// not. The child is forked here, and stays for many files: MRPT's registers, and a fork with a sanitizer's
// tables, take longer than a file. What the fuzzer counts in the child it sees in memory that both share.
#pragma once

#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <optional>
#include <string>

#include "slam_adapter/mrpt/reader_process.hpp"
#include "slam_adapter/mrpt/serve.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define MAPCODEC_FUZZ_ASAN
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define MAPCODEC_FUZZ_ASAN
#endif
#if __has_feature(coverage_sanitizer)
#define MAPCODEC_FUZZ_COUNTERS
#endif
#endif

#ifdef MAPCODEC_FUZZ_ASAN
extern "C" void __sanitizer_set_death_callback(void (*)());
#endif
#ifdef MAPCODEC_FUZZ_COUNTERS
// The linker's names of where they begin and end. In C++ they cannot be declared: Clang declares them itself,
// and would rename its own.
__asm__(
    ".pushsection .data.rel,\"aw\"\n.balign 8\n.globl mapcodec_fuzz_counters\n"
    "mapcodec_fuzz_counters: .quad __start___sancov_cntrs, __stop___sancov_cntrs\n.popsection");
extern "C" std::uint8_t* const mapcodec_fuzz_counters[2];
#endif

namespace mapcodec::fuzz {

constexpr std::uint64_t kReaderMemory = std::uint64_t{3} << 30;
constexpr int kFilesOfAChild = 2000;  // then a new one: MRPT loses memory where it throws

#ifdef MAPCODEC_FUZZ_ASAN
/// As malloc, which answers null where more is asked for than the options below allow.
inline void* allocate_or_throw(std::size_t size) {
  void* at = std::malloc(size);
  if (at == nullptr) throw std::bad_alloc();
  return at;
}
#endif

/// Whole pages alone: beside the counters lies what must not be shared.
inline void share_counters() {
#ifdef MAPCODEC_FUZZ_COUNTERS
  const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto begin = (reinterpret_cast<std::uintptr_t>(mapcodec_fuzz_counters[0]) + page - 1) / page * page;
  const auto end = reinterpret_cast<std::uintptr_t>(mapcodec_fuzz_counters[1]) / page * page;
  if (begin >= end) return;
  auto* at = reinterpret_cast<std::uint8_t*>(begin);
  const Bytes kept(at, at + (end - begin));
  if (::mmap(at, kept.size(), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_FIXED, -1, 0) != at)
    std::abort();
  std::memcpy(at, kept.data(), kept.size());
#endif
}

/// A child may die of what MRPT does, not of what our own code does: the sanitizer of undefined behaviour
/// sees our code alone.
inline bool* const is_ours = static_cast<bool*>(
    ::mmap(nullptr, sizeof(bool), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));

/// As the reading program, once for every byte that comes.
[[noreturn]] inline void be_the_reader(const std::string& path, int fd) {
  // Its death is no finding: neither the sanitizer nor a signal tells the fuzzer.
  for (const int s : {SIGALRM, SIGABRT, SIGINT, SIGTERM}) std::signal(s, SIG_DFL);
#ifdef MAPCODEC_FUZZ_ASAN
  __sanitizer_set_death_callback(nullptr);
#else
  (void)limit_process(kReaderMemory);
#endif
  ::close(STDERR_FILENO);
  char go = 0;
  while (::read(fd, &go, 1) == 1) {
    ::alarm(10);
    serve_log(path, {}, fd);
    ::alarm(0);
  }
  ::_exit(0);
}

/// As RawlogReader: every message is looked at. False: the child is gone.
inline bool be_the_asker(MessagePipe& pipe) {
  for (;;) {
    const auto m = pipe.read();
    if (!m.ok()) return false;
    if (m->kind == WireKind::frame) {
      const auto frame = read_frame(m->payload);
      if (!frame.ok()) std::abort();  // our own reader wrote it
    } else if (m->kind == WireKind::error) {
      const Error error = read_error(m->payload);
      if (error.message.empty()) std::abort();
      return true;
    } else {
      if (!read_summary(m->payload).ok()) std::abort();
      return true;
    }
  }
}

inline MessagePipe start_reader(int file) {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM, 0, ends) != 0) std::abort();
  const pid_t child = ::fork();
  if (child < 0) std::abort();
  if (child == 0) {
    ::close(ends[0]);
    be_the_reader("/proc/self/fd/" + std::to_string(file), ends[1]);
  }
  ::close(ends[1]);
  return MessagePipe(ends[0], ends[0], child);
}

inline int run(const std::uint8_t* data, std::size_t size, const char* name) {
  static const int file = (share_counters(), ::memfd_create(name, 0));
  static std::optional<MessagePipe> pipe;
  static int files = 0;
  if (file < 0 || ::ftruncate(file, 0) != 0 || ::pwrite(file, data, size, 0) != static_cast<ssize_t>(size))
    std::abort();
  if (!pipe || ++files > kFilesOfAChild) {
    pipe.emplace(start_reader(file));
    files = 0;
  }
  const std::uint8_t go[] = {1};
  if (!pipe->write(go).ok() || !be_the_asker(*pipe)) pipe.reset();
  if (*is_ours) std::abort();  // what it was: UBSAN_OPTIONS=log_path=FILE
  return 0;
}

}  // namespace mapcodec::fuzz

// Called by the sanitizer where there is one.
extern "C" void __ubsan_on_report() {
  *mapcodec::fuzz::is_ours = true;
}
#ifdef MAPCODEC_FUZZ_ASAN
// One program includes this once. The sanitizer's address space cannot be limited; its `new` ends the program
// where one would throw; and MRPT fills all that it asks for, and what it did not get. One file in twenty
// ends so: symbols for each report would take most of the time (ASAN_OPTIONS=symbolize=1 brings them back).
extern "C" const char* __asan_default_options() {
  return "max_allocation_size_mb=64:allocator_may_return_null=1:symbolize=0";
}
void* operator new(std::size_t size) {
  return mapcodec::fuzz::allocate_or_throw(size);
}
void* operator new[](std::size_t size) {
  return mapcodec::fuzz::allocate_or_throw(size);
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return std::malloc(size);
}
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return std::malloc(size);
}
void operator delete(void* at) noexcept {
  std::free(at);
}
void operator delete[](void* at) noexcept {
  std::free(at);
}
void operator delete(void* at, std::size_t) noexcept {
  std::free(at);
}
void operator delete[](void* at, std::size_t) noexcept {
  std::free(at);
}
#endif
