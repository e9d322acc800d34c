// SPDX-License-Identifier: GPL-3.0-or-later
// An archive as one file of a POSIX file system.
#pragma once

#include <string>

#include "maps/tile_store.hpp"

namespace mapcodec {

/// Owns a file descriptor.
class FileHandle {
 public:
  FileHandle() = default;
  explicit FileHandle(int fd) : fd_(fd) {}
  FileHandle(FileHandle&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileHandle& operator=(FileHandle&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }
  ~FileHandle();
  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] bool is_open() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// A new file grows under a temporary name beside its target and takes the target's name at the first
/// publish; until then its destruction removes it. An existing file grows at its end; destruction cuts off
/// what was not published. One fdatasync per publish; after a failed write or sync nothing more is written.
class FileStore final : public TileStore {
 public:
  /// For reading; needs no lock, also while a writer commits.
  /// Errors: NotFound, Unreadable (permission, folder, device).
  [[nodiscard]] static Result<std::unique_ptr<FileStore>> open_for_reading(const std::string& path);
  /// For appending; holds an exclusive flock until destroyed.
  /// Errors: as for reading; CannotWrite (permission, another writer).
  [[nodiscard]] static Result<std::unique_ptr<FileStore>> open_for_writing(const std::string& path);
  /// A new file that will appear at `path`.
  /// Errors: CannotWrite (exists and not `overwrite`, folder missing, permission, another writer).
  [[nodiscard]] static Result<std::unique_ptr<FileStore>> create(const std::string& path, bool overwrite);

  FileStore(const FileStore&) = delete;
  FileStore& operator=(const FileStore&) = delete;
  ~FileStore() override;

  [[nodiscard]] Result<SegmentRef> append(ByteSpan bytes) override;
  [[nodiscard]] Status publish(ByteSpan head) override;
  [[nodiscard]] Status discard_after(std::uint64_t end) override;
  [[nodiscard]] Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const override;
  [[nodiscard]] Result<std::uint64_t> end() const override;
  [[nodiscard]] std::uint64_t bytes_read() const override { return bytes_read_; }

 private:
  FileStore(FileHandle file, std::string path) : file_(std::move(file)), path_(std::move(path)) {}
  [[nodiscard]] Status write(ByteSpan bytes);
  [[nodiscard]] Status sync();
  [[nodiscard]] Status take_name();
  Error broken(const std::string& what);

  FileHandle file_;
  FileHandle replaced_;  // the file that a new one will replace: locked, so that nobody updates it meanwhile
  std::string path_;
  std::string temporary_;  // empty once the file has its final name
  bool overwrite_ = false;
  bool writable_ = false;
  bool broken_ = false;
  std::uint64_t end_ = 0;        // of what was written
  std::uint64_t published_ = 0;  // of what counts
  mutable std::atomic<std::uint64_t> bytes_read_{0};
};

}  // namespace mapcodec
