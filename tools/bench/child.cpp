// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/child.hpp"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>

extern char** environ;

namespace mapcodec::bench {

Result<std::string> output_of(std::vector<std::string> words) {
  int ends[2];
  if (::pipe(ends) != 0) return make_error(ErrorCode::kUnreadable, "no pipe");
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  pid_t child = 0;
  const int failed = ::posix_spawn(&child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string out;
  char block[4096];
  for (ssize_t n = 0; failed == 0 && (n = ::read(ends[0], block, sizeof block)) > 0;)
    out.append(block, std::size_t(n));
  ::close(ends[0]);
  int state = -1;
  if (failed == 0) ::waitpid(child, &state, 0);
  if (failed != 0 || !WIFEXITED(state) || WEXITSTATUS(state) != 0)
    return make_error(ErrorCode::kUnreadable, words[0] + " " + words[1] + " failed");
  return out;
}

Result<Json> json_of(std::vector<std::string> words) {
  MAPCODEC_ASSIGN(const std::string text, output_of(std::move(words)));
  Json all = Json::parse(text, nullptr, false);
  if (!all.is_discarded()) return all;
  const std::size_t line = text.rfind('{');
  Json last = line == std::string::npos ? Json() : Json::parse(text.substr(line), nullptr, false);
  if (last.is_discarded() || last.is_null()) return make_error(ErrorCode::kMalformed, "no JSON came back");
  return last;
}

std::string own_path() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).string();
}

}  // namespace mapcodec::bench
