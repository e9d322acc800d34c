// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "slam_adapter/formats/cursor.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

/// What one file format adds to a source: its records, in order.
class RecordReader {
 public:
  virtual ~RecordReader() = default;
  [[nodiscard]] virtual const RecordPlan& plan() const = 0;
  [[nodiscard]] virtual std::optional<std::uint64_t> announced_points() const = 0;
  /// Writes up to `max` records to `rows`; 0 at the end. What is wrong between file and header is found here.
  virtual Result<std::size_t> read(std::uint8_t* rows, std::size_t max) = 0;
  /// The next `read` gives the first record again.
  virtual void rewind() = 0;
  /// Records that the format itself marks as no point, left out so far.
  [[nodiscard]] virtual std::uint64_t skipped() const { return 0; }
  [[nodiscard]] virtual std::vector<std::string> warnings() const { return {}; }
};

using ReaderResult = Result<std::unique_ptr<RecordReader>>;

/// A source that knows how its file is called, for messages.
class NamedSource : public PointSource {
 public:
  explicit NamedSource(std::string name) : name_(std::move(name)) {}
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
};

/// The source over `reader`; keeps `stream` alive for it.
[[nodiscard]] std::unique_ptr<PointSource> make_source(std::unique_ptr<ByteStream> stream,
                                                       std::unique_ptr<RecordReader> reader, std::string name,
                                                       const ReadOptions& options);

/// Takes out the points with a NaN or infinite coordinate; returns their number.
std::size_t drop_nonfinite(PointCloud& block);

/// `error` with the file's name before the message.
[[nodiscard]] Error named(const std::string& name, Error error);

/// Reads `count` records of `stride` bytes from `cursor` on; the counts have been checked against the bytes
/// left.
[[nodiscard]] Result<std::size_t> read_records(Cursor& cursor, std::uint64_t count, std::size_t stride,
                                               std::uint8_t* rows, std::size_t max);

/// Error if `count` records of `stride` bytes are not exactly what is left in `cursor`.
[[nodiscard]] Status check_exact_size(const Cursor& cursor, std::uint64_t count, std::size_t stride);
/// Truncated if fewer than `count` records are left.
[[nodiscard]] Status check_enough(const Cursor& cursor, std::uint64_t count, std::size_t stride);

}  // namespace mapcodec
