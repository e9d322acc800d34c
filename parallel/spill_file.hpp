// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// A file without a name: it is gone when it is closed, or when the program ends in whatever way.
/// Threads: read and write from many at different offsets.
class SpillFile {
 public:
  /// @param folder  empty: the system's folder for temporary files.
  /// Errors: CannotWrite.
  [[nodiscard]] static Result<SpillFile> create(const std::string& folder);
  SpillFile(SpillFile&& other) noexcept;
  SpillFile& operator=(SpillFile&& other) noexcept;
  ~SpillFile();

  /// Errors: CannotWrite (disk full, ...), naming the folder.
  [[nodiscard]] Status write(std::uint64_t offset, ByteSpan bytes);
  /// Errors: Unreadable, Truncated.
  [[nodiscard]] Status read(std::uint64_t offset, std::span<std::uint8_t> bytes) const;

 private:
  SpillFile(int descriptor, std::string folder) : descriptor_(descriptor), folder_(std::move(folder)) {}
  int descriptor_ = -1;
  std::string folder_;
};

}  // namespace mapcodec
