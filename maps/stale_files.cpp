// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/stale_files.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <filesystem>
#include <optional>
#include <string_view>
#include <system_error>

#include "maps/file_store.hpp"

namespace mapcodec {
namespace {

namespace fs = std::filesystem;

/// Takes a whole number off the front of `text`.
std::optional<long> take_number(std::string_view& text) {
  long v = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), v);
  if (error != std::errc() || v < 0) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
  return v;
}

/// The process that a temporary of `target` is named after; nothing if the name is another one.
std::optional<pid_t> owner(std::string_view name, const std::string& target) {
  const std::string prefix = target + ".tmp-";
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  const auto pid = take_number(name);
  if (!pid || *pid == 0 || long{static_cast<pid_t>(*pid)} != *pid || !name.starts_with('-'))
    return std::nullopt;
  name.remove_prefix(1);
  if (!take_number(name) || !name.empty()) return std::nullopt;
  return static_cast<pid_t>(*pid);
}

bool is_gone(pid_t process) {
  return ::kill(process, 0) != 0 && errno == ESRCH;
}

void remove_unlocked(const fs::path& file) {
  const FileHandle handle(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC));
  if (handle.is_open() && ::flock(handle.fd(), LOCK_EX | LOCK_NB) == 0) ::unlink(file.c_str());
}

}  // namespace

void remove_stale_temporaries(const std::string& path) {
  const fs::path target(path);
  std::error_code error;
  fs::directory_iterator entry(target.has_parent_path() ? target.parent_path() : fs::path("."), error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const auto process = owner(entry->path().filename().native(), target.filename().native());
    std::error_code ignored;
    if (process && is_gone(*process) && entry->symlink_status(ignored).type() == fs::file_type::regular)
      remove_unlocked(entry->path());
  }
}

}  // namespace mapcodec
