// SPDX-License-Identifier: GPL-3.0-or-later
// The ROS bag format 2.0 (wiki.ros.org/Bags/Format/2.0): records of named fields and data; messages lie in
// chunks.
//
// This is a reader of our own since Debian's librosbag_storage cannot be shown hostile bytes: it allocates
// what a record's 32-bit length says, follows the file's own positions, loads the plugin that a field of the
// bag's header names as its encryptor, prints, and reads only from paths. It is the oracle in the tests.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {

struct BagConnection {
  std::string topic;
  std::string type;  ///< "sensor_msgs/PointCloud2"
};

struct BagChunk {
  std::uint64_t offset = 0;  ///< of the packed bytes
  std::uint32_t packed = 0, size = 0;
  std::string compression;
  /// Whose messages it holds, as the bag's index says; empty where it does not say.
  std::set<std::uint32_t> connections;
};

/// What a bag's records outside chunks say. Nothing is believed that has not been compared with the bytes.
struct BagFile {
  std::vector<BagChunk> chunks;
  std::map<std::uint32_t, BagConnection> connections;
  std::vector<std::string> warnings;

  /// Walks all records once. Errors: Malformed, Truncated (both with byte), Unsupported (other versions,
  /// encrypted), Empty (no chunk), those of the stream.
  [[nodiscard]] static Result<BagFile> open(const ByteStream& stream);
  /// Numbers of the connections of `type`.
  [[nodiscard]] std::set<std::uint32_t> of_type(const std::string& type) const;
};

struct BagMessage {
  std::uint32_t connection = 0;
  std::int64_t time_ns = 0;  ///< when it was recorded, since epoch
  ByteSpan bytes;            ///< the message as serialised; valid until the next call
};

/// Hands out messages in the order of the file; one unpacked chunk is held. Threads: one at a time.
class BagMessages {
 public:
  /// Both must outlive it. @param wanted  numbers of connections.
  BagMessages(const BagFile& bag, const ByteStream& stream, std::set<std::uint32_t> wanted)
      : bag_(bag), stream_(stream), wanted_(std::move(wanted)) {}

  /// False at the end. Errors: Malformed, Truncated, Unsupported, LimitExceeded (with the chunk's byte).
  [[nodiscard]] Result<bool> next(BagMessage& message);
  void rewind();
  /// Of the chunk that the last message came from, in the file.
  [[nodiscard]] std::uint64_t chunk_offset() const {
    return chunk_ == 0 ? 0 : bag_.chunks[chunk_ - 1].offset;
  }

 private:
  [[nodiscard]] Result<bool> load_chunk();

  const BagFile& bag_;
  const ByteStream& stream_;
  std::set<std::uint32_t> wanted_;
  std::size_t chunk_ = 0;  ///< the next to load
  Bytes bytes_;            ///< of the one before
  std::size_t at_ = 0;
};

}  // namespace mapcodec
