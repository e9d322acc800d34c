// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/spill_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

namespace mapcodec {
namespace {

std::string reason(int error) {
  return std::generic_category().message(error);
}

std::string folder_or_default(const std::string& folder) {
  if (!folder.empty()) return folder;
  std::error_code error;
  const std::filesystem::path p = std::filesystem::temp_directory_path(error);
  return error ? "/tmp" : p.string();
}

/// An unnamed file where the file system has them, else a named one that is unlinked at once.
int open_unnamed(const std::string& folder) {
#ifdef O_TMPFILE
  const int unnamed = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (unnamed >= 0) return unnamed;
#endif
  std::string name = folder + "/mapcodec-spill-XXXXXX";
  const int named = ::mkstemp(name.data());
  if (named >= 0) ::unlink(name.c_str());
  return named;
}

}  // namespace

Result<SpillFile> SpillFile::create(const std::string& folder) {
  std::string where = folder_or_default(folder);
  const int descriptor = open_unnamed(where);
  if (descriptor >= 0) return SpillFile(descriptor, std::move(where));
  return make_error(ErrorCode::kCannotWrite,
                    "cannot make a temporary file in " + where + ": " + reason(errno));
}

SpillFile::SpillFile(SpillFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), folder_(std::move(other.folder_)) {}

SpillFile& SpillFile::operator=(SpillFile&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(folder_, other.folder_);
  return *this;
}

SpillFile::~SpillFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Status SpillFile::write(std::uint64_t offset, ByteSpan bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      return make_error(ErrorCode::kCannotWrite,
                        "cannot write temporary data to " + folder_ + ": " + reason(errno));
    }
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
  return {};
}

Status SpillFile::read(std::uint64_t offset, std::span<std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n == 0)
      return make_error(ErrorCode::kTruncated, "temporary file in " + folder_ + " ends too early", offset);
    if (n < 0) {
      return make_error(ErrorCode::kUnreadable,
                        "cannot read temporary data in " + folder_ + ": " + reason(errno));
    }
    bytes = bytes.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
  return {};
}

}  // namespace mapcodec
