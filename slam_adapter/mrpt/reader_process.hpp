// SPDX-License-Identifier: GPL-3.0-or-later
// The program that reads and writes MRPT's files, as a child of this one. MRPT's deserialiser trusts counts
// that it reads, and loads OpenCV and more at its start: in a process of its own it can be limited, and what
// it does to itself hurts nobody.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "mapcodec/base/bytes.hpp"
#include "mapcodec/base/result.hpp"
#include "slam_adapter/mrpt/frame_wire.hpp"

namespace mapcodec {

/// Name of the program; looked for as $MAPCODEC_MRPT_READER says, beside the running program, in
/// ../libexec/mapcodec from there, where it was installed.
inline constexpr const char* kMrptProgram = "mapcodec-mrpt";

/// Messages from one end of a pipe, and to it. Closing kills and reaps the child. Threads: one at a time.
class MessagePipe {
 public:
  struct Message {
    WireKind kind = WireKind::end;
    Bytes payload;
  };
  /// Takes over the descriptors (-1: none) and the child (0: none).
  MessagePipe(int read_fd, int write_fd, pid_t child);
  MessagePipe(MessagePipe&& other) noexcept;
  MessagePipe& operator=(MessagePipe&& other) noexcept;
  ~MessagePipe();

  /// The next message. Errors: Malformed (the child died, by what signal; it stopped within a message; an
  /// unknown kind), LimitExceeded (a message too long; nothing came for `patience_s`).
  [[nodiscard]] Result<Message> read(double patience_s = 120);
  /// Errors: Malformed (the child is gone).
  [[nodiscard]] Status write(ByteSpan bytes);
  /// Tells the child that nothing more will come.
  void end_writing();

 private:
  [[nodiscard]] Status fill(std::uint8_t* to, std::size_t count, double patience_s, bool within);
  [[nodiscard]] Error death(bool within);
  void close_all();

  int read_fd_ = -1, write_fd_ = -1;
  pid_t child_ = 0;
};

/// Starts the program. Errors: Unsupported (it is nowhere to be found: built without MRPT).
[[nodiscard]] Result<MessagePipe> start_mrpt_program(const std::vector<std::string>& arguments);

/// Whether the program is to be found.
[[nodiscard]] bool has_mrpt_program();

}  // namespace mapcodec
