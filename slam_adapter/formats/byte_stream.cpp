// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/formats/byte_stream.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace mapcodec {
namespace {

class MemoryStream final : public ByteStream {
 public:
  explicit MemoryStream(ByteSpan bytes) : bytes_(bytes) {}
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  Result<std::size_t> read_at(std::uint64_t offset, std::uint8_t* to, std::size_t count) const override {
    if (offset >= bytes_.size()) return std::size_t{0};
    const std::size_t n = std::min<std::size_t>(count, bytes_.size() - offset);
    std::memcpy(to, bytes_.data() + offset, n);
    return n;
  }

 private:
  ByteSpan bytes_;
};

class FileStream final : public ByteStream {
 public:
  FileStream(int fd, std::uint64_t size) : fd_(fd), size_(size) {}
  FileStream(const FileStream&) = delete;
  FileStream& operator=(const FileStream&) = delete;
  ~FileStream() override { ::close(fd_); }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  Result<std::size_t> read_at(std::uint64_t offset, std::uint8_t* to, std::size_t count) const override {
    std::size_t done = 0;
    while (done < count) {
      const ssize_t n = ::pread(fd_, to + done, count - done, static_cast<off_t>(offset + done));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) {
        return make_error(ErrorCode::kUnreadable, std::string("cannot be read: ") + std::strerror(errno),
                          offset + done);
      }
      if (n == 0) break;
      done += static_cast<std::size_t>(n);
    }
    return done;
  }

 private:
  int fd_;
  std::uint64_t size_;
};

Error open_error(int number) {
  if (number == ENOENT || number == ENOTDIR) return make_error(ErrorCode::kNotFound, "no such file");
  return make_error(ErrorCode::kUnreadable, std::string("cannot be opened: ") + std::strerror(number));
}

}  // namespace

std::unique_ptr<ByteStream> memory_stream(ByteSpan bytes) {
  return std::make_unique<MemoryStream>(bytes);
}

Result<std::unique_ptr<ByteStream>> file_stream(const std::string& path) {
  // Not blocking: a FIFO that nobody writes to must be refused, not waited for.
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) return open_error(errno);
  struct stat info {};
  const bool known = ::fstat(fd, &info) == 0;
  if (known && S_ISREG(info.st_mode)) {
    return std::unique_ptr<ByteStream>(
        std::make_unique<FileStream>(fd, static_cast<std::uint64_t>(info.st_size)));
  }
  ::close(fd);
  if (known && S_ISDIR(info.st_mode)) return make_error(ErrorCode::kUnreadable, "is a directory");
  return make_error(ErrorCode::kUnreadable, "is not a regular file");
}

}  // namespace mapcodec
