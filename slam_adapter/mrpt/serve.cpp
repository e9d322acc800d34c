// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/serve.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>

#include "slam_adapter/mrpt/frame_wire.hpp"
#include "slam_adapter/mrpt/reader_process.hpp"
#include "slam_adapter/mrpt/simplemap_writer.hpp"

namespace mapcodec {
namespace {

Status write_all(int fd, ByteSpan bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return make_error(ErrorCode::kCancelled, "nobody listens");
    done += static_cast<std::size_t>(n);
  }
  return {};
}

Status send(int fd, WireKind kind, const Bytes& payload) {
  if (payload.size() > kMaxWirePayload)
    return make_error(ErrorCode::kLimitExceeded, "an observation of more than a gigabyte");
  return write_all(fd, write_message(kind, payload));
}

template <class T>
void answer(int fd, const Result<T>& result, const RawlogSummary& summary) {
  // If nobody listens any more, nobody needs the answer.
  (void)(result.ok() ? send(fd, WireKind::end, write_summary(summary))
                     : send(fd, WireKind::error, write_error(result.error())));
}

Result<RawlogSummary> write_simplemap(const std::string& path, std::uint32_t keyframes, int fd) {
  MAPCODEC_ASSIGN(SimplemapWriter writer, SimplemapWriter::create(path, keyframes));
  MessagePipe in(fd, -1, 0);
  for (std::uint32_t i = 0; i < keyframes; ++i) {
    MAPCODEC_ASSIGN(const MessagePipe::Message m, in.read());
    if (m.kind != WireKind::frame) return make_error(ErrorCode::kMalformed, "a keyframe is missing");
    MAPCODEC_ASSIGN(const RawlogFrame frame, read_frame(m.payload));
    MAPCODEC_TRY(writer.add(frame));
  }
  MAPCODEC_TRY(writer.finish());
  return RawlogSummary{};
}

}  // namespace

Status limit_process(std::uint64_t memory_bytes) {
  const rlimit no_core{0, 0};
  bool limited = ::setrlimit(RLIMIT_CORE, &no_core) == 0;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // Sanitizers reserve terabytes of addresses for their own.
  const rlimit memory{memory_bytes, memory_bytes};
  limited = limited && ::setrlimit(RLIMIT_AS, &memory) == 0;
#else
  (void)memory_bytes;
#endif
  if (!limited) return make_error(ErrorCode::kInvalidArgument, "the reader's memory cannot be limited");
  return {};
}

void serve_log(const std::string& path, const LogSettings& settings, int fd) {
  const auto summary = read_log(
      path, settings, [&](RawlogFrame&& frame) { return send(fd, WireKind::frame, write_frame(frame)); });
  answer(fd, summary, summary.ok() ? *summary : RawlogSummary{});
}

void serve_simplemap(const std::string& path, std::uint32_t keyframes, int fd) {
  const int in = ::dup(fd);
  const auto done = write_simplemap(path, keyframes, in);
  answer(fd, done, RawlogSummary{});
}

}  // namespace mapcodec
