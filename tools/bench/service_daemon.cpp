// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "tools/bench/service.hpp"

extern char** environ;

namespace mapcodec::bench {
namespace fs = std::filesystem;

Result<ChildDaemon> ChildDaemon::start(const std::string& folder, const std::string& config) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error).parent_path() / "mapcodecd";
  if (!fs::exists(program, error))
    return make_error(ErrorCode::kNotFound, program.string() + ": is not there");
  ChildDaemon d;
  d.folder_ = folder;
  fs::remove_all(folder, error);
  fs::create_directories(folder + "/maps", error);
  const std::string data = folder + "/maps", ports = folder + "/ports", log = folder + "/log",
                    settings = folder + "/mapcodecd.toml";
  std::ofstream(settings) << config;
  std::vector<std::string> words{program.string(), "--data",      data,          "--listen", "127.0.0.1:0",
                                 "--http",         "127.0.0.1:0", "--port-file", ports,      "--log-level",
                                 "warn",           "--config",    settings};
  std::vector<char*> argv;
  for (std::string& w : words) argv.push_back(w.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  const int failed = posix_spawn(&d.pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return make_error(ErrorCode::kUnreachable, "mapcodecd cannot be started");
  for (int i = 0; i < 600 && !fs::exists(ports, error); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  std::ifstream(ports) >> d.address_;
  if (d.address_.empty()) return make_error(ErrorCode::kUnreachable, "mapcodecd does not listen: see " + log);
  return d;
}

ChildDaemon::ChildDaemon(ChildDaemon&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      address_(std::move(other.address_)),
      folder_(std::move(other.folder_)) {}

ChildDaemon::~ChildDaemon() {
  if (pid_ > 0) (void)stop();
}

bool ChildDaemon::stop() {
  ::kill(pid_, SIGTERM);
  int status = 0;
  ::waitpid(std::exchange(pid_, -1), &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

double ChildDaemon::resident_mb() const {
  std::ifstream in("/proc/" + std::to_string(pid_) + "/statm");
  double all = 0, resident = 0;
  in >> all >> resident;
  return resident * double(::sysconf(_SC_PAGESIZE)) / 1e6;
}

double ChildDaemon::cpu_seconds() const {
  std::ifstream in("/proc/" + std::to_string(pid_) + "/stat");
  std::string word;
  double ticks = 0;
  for (int i = 1; i <= 15 && in >> word; ++i) {
    if (i >= 14) ticks += std::strtod(word.c_str(), nullptr);
  }
  return ticks / double(::sysconf(_SC_CLK_TCK));
}

}  // namespace mapcodec::bench
