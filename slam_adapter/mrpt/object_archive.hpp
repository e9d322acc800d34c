// SPDX-License-Identifier: GPL-3.0-or-later
// MRPT's archive of objects over a file that may be zipped, with a view of what comes next.
#pragma once

#include <mrpt/serialization/CArchive.h>

#include <memory>
#include <string>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// What stands before an object: its class, the version of its layout.
struct ObjectHeader {
  std::string class_name;
  std::uint8_t version = 0;
  bool old = false;        ///< of MRPT before 0.5: numbers of 4 bytes, and no byte at the end of the object
  std::size_t length = 0;  ///< bytes of the header
};

/// What MRPT throws comes through its methods: callers catch it. Threads: one at a time.
class ObjectArchive final : public mrpt::serialization::CArchive {
 public:
  /// Errors: NotFound, Unreadable, Empty, Unsupported (a zstd stream).
  [[nodiscard]] static Result<std::unique_ptr<ObjectArchive>> open(const std::string& path);
  ~ObjectArchive() override;
  ObjectArchive(const ObjectArchive&) = delete;
  ObjectArchive& operator=(const ObjectArchive&) = delete;

  /// Up to `count` bytes (at most 64 KiB) that will be read next; fewer at the end.
  [[nodiscard]] ByteSpan peek(std::size_t count);
  void skip(std::size_t count);
  [[nodiscard]] bool at_end() { return peek(1).empty(); }
  /// The header that begins `ahead` bytes further on, if one can.
  [[nodiscard]] std::optional<ObjectHeader> header(std::size_t ahead = 0);

  [[nodiscard]] std::uint64_t position() const { return position_; }  ///< [bytes, unpacked]
  [[nodiscard]] std::uint64_t file_offset() const;                    ///< [bytes of the file]
  /// The end came while an object was being read.
  [[nodiscard]] bool ran_out() const { return ran_out_; }
  /// What the unpacker found wrong; empty if nothing.
  [[nodiscard]] const std::string& unpacking_error() const { return unpacking_error_; }

 protected:
  std::size_t read(void* to, std::size_t count) override;
  std::size_t write(const void* from, std::size_t count) override;

 private:
  explicit ObjectArchive(void* file) : file_(file) {}
  void fill();

  void* file_;  // gzFile
  Bytes buffer_;
  std::size_t at_ = 0;
  std::uint64_t position_ = 0;
  bool ended_ = false, ran_out_ = false;
  std::string unpacking_error_;
};

}  // namespace mapcodec
