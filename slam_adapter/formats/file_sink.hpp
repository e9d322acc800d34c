// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// A file that appears under its name only when complete. All errors are CannotWrite and name the path.
class OutputFile {
 public:
  OutputFile() = default;
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  /// Removes the temporary if `commit` has not been called or has failed.
  ~OutputFile();

  /// Makes the temporary beside `path`.
  Status open(const std::string& path);
  /// Appends through a buffer.
  Status append(ByteSpan bytes);
  Status append(std::string_view text) {
    return append(ByteSpan(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  }
  /// Overwrites or extends at `offset`, past the buffer.
  Status write_at(std::uint64_t offset, ByteSpan bytes);
  /// Flushes, syncs, closes, renames, syncs the folder.
  Status commit();
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  Status flush();
  Status fail(const char* what, int number);

  std::string path_, target_, temporary_;
  int fd_ = -1;
  Bytes buffer_;
  std::uint64_t flushed_ = 0;
};

}  // namespace mapcodec
