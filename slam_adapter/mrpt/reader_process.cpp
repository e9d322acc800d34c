// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/reader_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

extern char** environ;

#ifndef MAPCODEC_MRPT_INSTALLED
#define MAPCODEC_MRPT_INSTALLED ""
#endif

namespace mapcodec {
namespace {

void close_fd(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

std::string find_program() {
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (const char* named = std::getenv("MAPCODEC_MRPT_READER"); named != nullptr) return named;
  const fs::path folder = fs::read_symlink("/proc/self/exe", ignored).parent_path();
  for (const fs::path& p : {folder / kMrptProgram, folder / "../libexec/mapcodec" / kMrptProgram,
                            fs::path(MAPCODEC_MRPT_INSTALLED)}) {
    if (!p.empty() && ::access(p.c_str(), X_OK) == 0) return p.string();
  }
  return {};
}

/// A pipe whose ends no other child inherits.
struct Pair {
  int ours = -1, theirs = -1;
  ~Pair() {
    close_fd(ours);
    close_fd(theirs);
  }
  Status open() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
      return make_error(ErrorCode::kUnreadable, std::string("no pipe: ") + std::strerror(errno));
    ours = ends[0];
    theirs = ends[1];
    return {};
  }
};

Result<pid_t> spawn(const std::string& program, const std::vector<std::string>& arguments, int fd) {
  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fd, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fd, STDOUT_FILENO);
  // What MRPT, OpenCV and libjpeg print is not ours to show: errors come as messages.
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed = ::posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    return make_error(ErrorCode::kUnsupported,
                      program + " cannot be started (" + std::strerror(failed) + ")");
  return child;
}

}  // namespace

MessagePipe::MessagePipe(int read_fd, int write_fd, pid_t child)
    : read_fd_(read_fd), write_fd_(write_fd), child_(child) {}
MessagePipe::MessagePipe(MessagePipe&& o) noexcept
    : read_fd_(std::exchange(o.read_fd_, -1)),
      write_fd_(std::exchange(o.write_fd_, -1)),
      child_(std::exchange(o.child_, 0)) {}
MessagePipe& MessagePipe::operator=(MessagePipe&& o) noexcept {
  if (this == &o) return *this;
  close_all();
  read_fd_ = std::exchange(o.read_fd_, -1);
  write_fd_ = std::exchange(o.write_fd_, -1);
  child_ = std::exchange(o.child_, 0);
  return *this;
}
MessagePipe::~MessagePipe() {
  close_all();
}

void MessagePipe::close_all() {
  if (write_fd_ == read_fd_) write_fd_ = -1;
  close_fd(read_fd_);
  close_fd(write_fd_);
  if (child_ > 0) {
    ::kill(child_, SIGKILL);
    while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
    }
  }
  child_ = 0;
}

Error MessagePipe::death(bool within) {
  int state = 0;
  if (child_ > 0 && ::waitpid(child_, &state, 0) == child_) {
    child_ = 0;
    if (WIFSIGNALED(state)) {
      return make_error(ErrorCode::kMalformed, std::string("MRPT's reader does not survive this file: ") +
                                                   ::strsignal(WTERMSIG(state)));
    }
    if (WIFEXITED(state) && WEXITSTATUS(state) == 127)
      return make_error(ErrorCode::kUnsupported, std::string(kMrptProgram) + " cannot be started");
  }
  return make_error(ErrorCode::kMalformed, within ? "the reader's answer breaks off within a message"
                                                  : "the reader's answer breaks off");
}

Status MessagePipe::fill(std::uint8_t* to, std::size_t count, double patience_s, bool within) {
  for (std::size_t done = 0; done < count;) {
    pollfd ready{read_fd_, POLLIN, 0};
    const int n = ::poll(&ready, 1, static_cast<int>(1e3 * patience_s));
    if (n < 0 && errno == EINTR) continue;
    if (n == 0)
      return make_error(ErrorCode::kLimitExceeded, "MRPT's reader is lost in this file: no answer for " +
                                                       std::to_string(int(patience_s)) + " s");
    const ssize_t got = n < 0 ? -1 : ::read(read_fd_, to + done, count - done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return death(within || done > 0);
    done += static_cast<std::size_t>(got);
  }
  return {};
}

Result<MessagePipe::Message> MessagePipe::read(double patience_s) {
  std::uint8_t head[kWireHeader];
  MAPCODEC_TRY(fill(head, sizeof head, patience_s, false));
  ByteReader in(ByteSpan(head, sizeof head));
  Message m;
  m.kind = static_cast<WireKind>(in.u8());
  const std::uint32_t length = in.u32();
  if (m.kind < WireKind::frame || m.kind > WireKind::error)
    return make_error(ErrorCode::kMalformed, "the reader's answer holds an unknown message");
  if (length > kMaxWirePayload)
    return make_error(ErrorCode::kLimitExceeded, "an observation of more than a gigabyte");
  m.payload.resize(length);
  MAPCODEC_TRY(fill(m.payload.data(), length, patience_s, true));
  return m;
}

Status MessagePipe::write(ByteSpan bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::send(write_fd_, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return make_error(ErrorCode::kMalformed, "MRPT's writer is gone");
    done += static_cast<std::size_t>(n);
  }
  return {};
}

void MessagePipe::end_writing() {
  ::shutdown(write_fd_, SHUT_WR);
}

Result<MessagePipe> start_mrpt_program(const std::vector<std::string>& arguments) {
  const std::string program = find_program();
  if (program.empty()) {
    return make_error(ErrorCode::kUnsupported,
                      std::string("needs MRPT: the program ") + kMrptProgram +
                          " is not beside this one (build with MAPCODEC_MRPT and Debian's libmrpt-slam-dev)");
  }
  Pair pair;
  MAPCODEC_TRY(pair.open());
  MAPCODEC_ASSIGN(const pid_t child, spawn(program, arguments, pair.theirs));
  const int fd = std::exchange(pair.ours, -1);
  return MessagePipe(fd, fd, child);
}

bool has_mrpt_program() {
  return !find_program().empty();
}

}  // namespace mapcodec
