// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/file_sink.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace mapcodec {
namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 20;

/// A name that no other writer in any process uses.
std::string temporary_name(const std::filesystem::path& target) {
  static std::atomic<unsigned> counter{0};
  const std::string suffix = ".part" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
  return (target.parent_path() / ("." + target.filename().string() + suffix)).string();
}

int write_all(int fd, std::uint64_t offset, const std::uint8_t* from, std::size_t count) {
  while (count > 0) {
    const ssize_t n = ::pwrite(fd, from, count, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return n < 0 ? errno : EIO;
    from += n;
    offset += static_cast<std::uint64_t>(n);
    count -= static_cast<std::size_t>(n);
  }
  return 0;
}

int sync_folder(const std::string& target) {
  std::string folder = std::filesystem::path(target).parent_path().string();
  if (folder.empty()) folder = ".";
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0)
    return errno == EACCES ? 0 : errno;  // a folder that may be written but not read cannot be synced
  const int error = ::fsync(fd) != 0 && errno != EINVAL ? errno : 0;
  ::close(fd);
  return error;
}

}  // namespace

OutputFile::~OutputFile() {
  if (fd_ >= 0) ::close(fd_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

Status OutputFile::fail(const char* what, int number) {
  return make_error(ErrorCode::kCannotWrite, path_ + ": " + what + ": " + std::strerror(number));
}

Status OutputFile::open(const std::string& path) {
  path_ = path;
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (std::filesystem::is_directory(status)) return fail("cannot be written", EISDIR);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return make_error(ErrorCode::kCannotWrite, path_ + ": is not a regular file");
  }
  // Renaming would replace a file that is write-protected.
  if (std::filesystem::exists(status) && ::access(path.c_str(), W_OK) != 0)
    return fail("cannot be written", errno);
  // A link stays a link: its target is what gets replaced.
  const auto real = std::filesystem::weakly_canonical(path, error);
  target_ = error ? path : real.string();
  const std::string name = temporary_name(target_);
  fd_ = ::open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (fd_ < 0) return fail("cannot be created", errno);
  temporary_ = name;
  return {};
}

Status OutputFile::flush() {
  const int error = write_all(fd_, flushed_, buffer_.data(), buffer_.size());
  if (error != 0) return fail("cannot be written", error);
  flushed_ += buffer_.size();
  buffer_.clear();
  return {};
}

Status OutputFile::append(ByteSpan bytes) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  return buffer_.size() >= kBuffer ? flush() : Status();
}

Status OutputFile::write_at(std::uint64_t offset, ByteSpan bytes) {
  MAPCODEC_TRY(flush());
  const int error = write_all(fd_, offset, bytes.data(), bytes.size());
  return error != 0 ? fail("cannot be written", error) : Status();
}

Status OutputFile::commit() {
  MAPCODEC_TRY(flush());
  if (::fsync(fd_) != 0) return fail("cannot be synced", errno);
  const int closed = ::close(fd_);
  fd_ = -1;
  if (closed != 0) return fail("cannot be closed", errno);
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) return fail("cannot be renamed into place", errno);
  temporary_.clear();
  const int error = sync_folder(target_);
  return error != 0 ? fail("its folder cannot be synced", error) : Status();
}

}  // namespace mapcodec
