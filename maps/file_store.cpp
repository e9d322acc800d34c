// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/file_store.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "mapcodec/base/crc32c.hpp"
#include "maps/stale_files.hpp"

namespace mapcodec {
namespace {

Error system_error(ErrorCode code, const std::string& what,
                   std::optional<std::uint64_t> offset = std::nullopt) {
  return make_error(code, what + ": " + std::strerror(errno), offset);
}

Error cannot_write(const std::string& what) {
  return make_error(ErrorCode::kCannotWrite, what);
}

int open_file(const std::string& path, int flags, mode_t mode = 0) {
  int fd = -1;
  do fd = ::open(path.c_str(), flags | O_CLOEXEC, mode);
  while (fd < 0 && errno == EINTR);
  return fd;
}

std::string folder_of(const std::string& path) {
  const auto slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

Status check_regular(int fd, ErrorCode code) {
  struct stat s {};
  if (::fstat(fd, &s) != 0) return system_error(code, "cannot be examined");
  if (S_ISDIR(s.st_mode)) return make_error(code, "is a folder, not a map archive");
  if (!S_ISREG(s.st_mode)) return make_error(code, "is not a regular file");
  return {};
}

Result<FileHandle> open_regular(const std::string& path, int flags) {
  // Without O_NONBLOCK a pipe would block the open itself.
  FileHandle file(open_file(path, flags | O_NONBLOCK));
  if (!file.is_open() && (errno == ENOENT || errno == ENOTDIR))
    return system_error(ErrorCode::kNotFound, "cannot be opened");
  if (!file.is_open() && errno == EISDIR)
    return make_error(ErrorCode::kUnreadable, "is a folder, not a map archive");
  if (!file.is_open()) {
    return system_error((flags & O_ACCMODE) == O_RDONLY ? ErrorCode::kUnreadable : ErrorCode::kCannotWrite,
                        "cannot be opened");
  }
  MAPCODEC_TRY(check_regular(file.fd(), ErrorCode::kUnreadable));
  return file;
}

Status lock(int fd) {
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return {};
  if (errno == EWOULDBLOCK) return cannot_write("another program is writing to this archive");
  return system_error(ErrorCode::kCannotWrite, "cannot be locked");
}

/// True if `path` still names the file that `fd` has open: a writer may have replaced it before the lock was
/// taken.
bool still_named(int fd, const std::string& path) {
  struct stat a {
  }, b{};
  return ::fstat(fd, &a) == 0 && ::stat(path.c_str(), &b) == 0 && a.st_dev == b.st_dev &&
         a.st_ino == b.st_ino;
}

/// Locks what a new file is about to replace; no handle if there is nothing.
Result<FileHandle> lock_replaced(const std::string& path, bool overwrite) {
  struct stat s {};
  if (::stat(path.c_str(), &s) != 0) return FileHandle();
  if (S_ISDIR(s.st_mode)) return cannot_write("is a folder");
  if (!S_ISREG(s.st_mode)) return cannot_write("is not a regular file");
  if (!overwrite) return cannot_write("exists already");
  FileHandle file(open_file(path, O_RDONLY | O_NONBLOCK));
  if (!file.is_open()) return file;  // one that we may not read cannot be locked, but may be replaced
  MAPCODEC_TRY(lock(file.fd()));
  if (!still_named(file.fd(), path)) return cannot_write("another program has just replaced this archive");
  return file;
}

/// Who may read the old file may read the new one. Where that cannot be had, the new one is the stricter.
void keep_permissions(const FileHandle& from, const FileHandle& to) {
  struct stat s {};
  if (!from.is_open() || ::fstat(from.fd(), &s) != 0) return;
  [[maybe_unused]] const int owner = ::fchown(to.fd(), s.st_uid, s.st_gid);
  [[maybe_unused]] const int mode = ::fchmod(to.fd(), s.st_mode & 0777);
}

Status write_all(int fd, ByteSpan bytes, std::uint64_t offset) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error(ErrorCode::kCannotWrite, "cannot be written", offset);
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
  return {};
}

Status sync_folder(const std::string& folder) {
  const FileHandle handle(open_file(folder, O_RDONLY | O_DIRECTORY));
  if (!handle.is_open() || (::fsync(handle.fd()) != 0 && errno != EINVAL)) {
    return system_error(ErrorCode::kCannotWrite, "the folder cannot be synchronised");
  }
  return {};
}

int rename_file(const std::string& from, const std::string& to, bool overwrite) {
#ifdef RENAME_NOREPLACE
  if (!overwrite) {
    const int r = ::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE);
    if (r == 0 || (errno != EINVAL && errno != ENOSYS)) return r;
  }
#endif
  if (!overwrite && ::access(to.c_str(), F_OK) == 0) {
    errno = EEXIST;
    return -1;
  }
  return std::rename(from.c_str(), to.c_str());
}

}  // namespace

FileHandle::~FileHandle() {
  if (fd_ >= 0) ::close(fd_);
}

Result<std::unique_ptr<FileStore>> FileStore::open_for_reading(const std::string& path) {
  MAPCODEC_ASSIGN(FileHandle file, open_regular(path, O_RDONLY));
  return std::unique_ptr<FileStore>(new FileStore(std::move(file), path));
}

Result<std::unique_ptr<FileStore>> FileStore::open_for_writing(const std::string& path) {
  MAPCODEC_ASSIGN(FileHandle file, open_regular(path, O_RDWR));
  MAPCODEC_TRY(lock(file.fd()));
  if (!still_named(file.fd(), path)) return cannot_write("another program has just replaced this archive");
  std::unique_ptr<FileStore> store(new FileStore(std::move(file), path));
  MAPCODEC_ASSIGN(store->end_, store->end());
  store->published_ = store->end_;
  store->writable_ = true;
  return store;
}

Result<std::unique_ptr<FileStore>> FileStore::create(const std::string& path, bool overwrite) {
  MAPCODEC_ASSIGN(FileHandle replaced, lock_replaced(path, overwrite));
  remove_stale_temporaries(path);
  FileHandle file;
  std::string temporary;
  for (int attempt = 0; attempt < 100 && !file.is_open(); ++attempt) {
    temporary = path;
    temporary.append(".tmp-").append(std::to_string(::getpid())).append("-").append(std::to_string(attempt));
    file = FileHandle(open_file(temporary, O_RDWR | O_CREAT | O_EXCL, 0666));
    if (!file.is_open() && errno != EEXIST) break;
  }
  if (!file.is_open()) return system_error(ErrorCode::kCannotWrite, "cannot be created");
  std::unique_ptr<FileStore> store(new FileStore(std::move(file), path));
  store->temporary_ = temporary;
  keep_permissions(replaced, store->file_);
  store->replaced_ = std::move(replaced);
  store->overwrite_ = overwrite;
  store->writable_ = true;
  MAPCODEC_TRY(lock(store->file_.fd()));
  return store;
}

FileStore::~FileStore() {
  if (!temporary_.empty()) {
    ::unlink(temporary_.c_str());
  } else if (writable_ && end_ > published_) {
    // Only tidiness: readers ignore the tail, and the next writer cuts it off.
    [[maybe_unused]] const int ignored = ::ftruncate(file_.fd(), static_cast<off_t>(published_));
  }
}

Error FileStore::broken(const std::string& what) {
  broken_ = true;
  return cannot_write(what);
}

Status FileStore::write(ByteSpan bytes) {
  if (!writable_) return broken("is open for reading only");
  if (broken_) return cannot_write("an earlier write failed, nothing more is written");
  Status written = write_all(file_.fd(), bytes, end_);
  broken_ = !written.ok();
  end_ += bytes.size();  // also of a failed write, so that destruction cuts off its beginning
  return written;
}

Status FileStore::sync() {
  // After a failed sync the kernel may have dropped the pages: a second try would succeed and prove nothing.
  if (::fdatasync(file_.fd()) == 0) return {};
  broken_ = true;
  return system_error(ErrorCode::kCannotWrite, "cannot be synchronised to the disk");
}

Status FileStore::take_name() {
  if (rename_file(temporary_, path_, overwrite_) != 0) {
    broken_ = true;
    return system_error(ErrorCode::kCannotWrite, "cannot take its final name");
  }
  temporary_.clear();
  replaced_ = FileHandle();
  Status synced = sync_folder(folder_of(path_));
  broken_ = !synced.ok();
  return synced;
}

Result<SegmentRef> FileStore::append(ByteSpan bytes) {
  const SegmentRef ref{end_, static_cast<std::uint32_t>(bytes.size()), crc32c(bytes)};
  MAPCODEC_TRY(write(bytes));
  return ref;
}

Status FileStore::publish(ByteSpan head) {
  // A head must not reach the disk before what it speaks of. A new file has no name until all of it is there.
  if (temporary_.empty() && end_ > published_) MAPCODEC_TRY(sync());
  MAPCODEC_TRY(write(head));
  MAPCODEC_TRY(sync());
  if (!temporary_.empty()) MAPCODEC_TRY(take_name());
  published_ = end_;
  return {};
}

Status FileStore::discard_after(std::uint64_t end) {
  if (!writable_ || broken_) return cannot_write("cannot be written any more");
  if (::ftruncate(file_.fd(), static_cast<off_t>(end)) != 0) {
    return system_error(ErrorCode::kCannotWrite, "the remains of an unfinished commit cannot be cut off",
                        end);
  }
  end_ = published_ = end;
  return {};
}

Result<Bytes> FileStore::read(std::uint64_t offset, std::uint64_t length) const {
  MAPCODEC_ASSIGN(const std::uint64_t size, end());
  if (offset > size || length > size - offset)
    return make_error(ErrorCode::kTruncated, "the file ends too early", size);
  Bytes bytes(length);
  for (std::size_t done = 0; done < length;) {
    const ssize_t n =
        ::pread(file_.fd(), bytes.data() + done, length - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error(ErrorCode::kUnreadable, "cannot be read", offset + done);
    if (n == 0) return make_error(ErrorCode::kTruncated, "the file ends too early", offset + done);
    done += static_cast<std::size_t>(n);
  }
  bytes_read_ += length;
  return bytes;
}

Result<std::uint64_t> FileStore::end() const {
  struct stat s {};
  if (::fstat(file_.fd(), &s) != 0) return system_error(ErrorCode::kUnreadable, "cannot be examined");
  return static_cast<std::uint64_t>(s.st_size);
}

Result<SegmentRef> MemoryStore::append(ByteSpan bytes) {
  const SegmentRef ref{bytes_.size(), static_cast<std::uint32_t>(bytes.size()), crc32c(bytes)};
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  return ref;
}

Status MemoryStore::publish(ByteSpan head) {
  bytes_.insert(bytes_.end(), head.begin(), head.end());
  return {};
}

Status MemoryStore::discard_after(std::uint64_t end) {
  bytes_.resize(std::min<std::uint64_t>(end, bytes_.size()));
  return {};
}

Result<Bytes> MemoryStore::read(std::uint64_t offset, std::uint64_t length) const {
  if (offset > bytes_.size() || length > bytes_.size() - offset) {
    return make_error(ErrorCode::kTruncated, "the archive ends too early", bytes_.size());
  }
  bytes_read_ += length;
  const auto first = bytes_.begin() + static_cast<std::ptrdiff_t>(offset);
  return Bytes(first, first + static_cast<std::ptrdiff_t>(length));
}

}  // namespace mapcodec
