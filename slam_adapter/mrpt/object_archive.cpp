// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/object_archive.hpp"

#include <zlib.h>

#include <algorithm>
#include <cctype>
#include <cstring>

#include "slam_adapter/formats/byte_stream.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kBuffer = std::size_t{1} << 18, kLongestPeek = std::size_t{1} << 16;
constexpr std::uint8_t kNewFormat = 0x80;  // in the length of a class's name
constexpr std::size_t kLongestName = 120;

gzFile gz(void* file) {
  return static_cast<gzFile>(file);
}

bool is_name(ByteSpan name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](std::uint8_t c) {
    return std::isalnum(c) || c == '_' || c == ':' || c == '<' || c == '>' || c == ',' || c == ' ';
  });
}

}  // namespace

Result<std::unique_ptr<ObjectArchive>> ObjectArchive::open(const std::string& path) {
  MAPCODEC_ASSIGN(const std::unique_ptr<ByteStream> stream, file_stream(path));
  if (stream->size() == 0) return make_error(ErrorCode::kEmpty, "is empty (0 bytes)");
  std::uint8_t head[4] = {};
  MAPCODEC_ASSIGN(const std::size_t count, stream->read_at(0, head, sizeof head));
  if (count == 4 && std::memcmp(head, "\x28\xb5\x2f\xfd", 4) == 0)
    return make_error(
        ErrorCode::kUnsupported,
        "is a zstd stream, as newer versions of MRPT write them: unpack it first with 'zstd -d'");
  gzFile file = gzopen(path.c_str(), "rbe");
  if (file == nullptr) return make_error(ErrorCode::kUnreadable, "cannot be opened");
  gzbuffer(file, 1 << 17);
  return std::unique_ptr<ObjectArchive>(new ObjectArchive(file));
}

ObjectArchive::~ObjectArchive() {
  gzclose_r(gz(file_));
}

std::uint64_t ObjectArchive::file_offset() const {
  const auto at = gzoffset(gz(file_));
  return at < 0 ? 0 : static_cast<std::uint64_t>(at);
}

void ObjectArchive::fill() {
  if (ended_) return;
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
  const std::size_t had = buffer_.size();
  buffer_.resize(had + kBuffer);
  const int got = gzread(gz(file_), buffer_.data() + had, static_cast<unsigned>(kBuffer));
  buffer_.resize(had + static_cast<std::size_t>(std::max(0, got)));
  int code = Z_OK;
  (void)gzerror(gz(file_), &code);
  if (got < 0 || (code != Z_OK && code != Z_STREAM_END)) {
    unpacking_error_ = code == Z_BUF_ERROR ? "the zipped stream breaks off" : "the zipped stream is damaged";
  }
  ended_ = got < static_cast<int>(kBuffer);
}

ByteSpan ObjectArchive::peek(std::size_t count) {
  count = std::min(count, kLongestPeek);
  if (buffer_.size() - at_ < count) fill();
  return ByteSpan(buffer_).subspan(at_, std::min(count, buffer_.size() - at_));
}

void ObjectArchive::skip(std::size_t count) {
  count = std::min(count, buffer_.size() - at_);
  at_ += count;
  position_ += count;
}

std::optional<ObjectHeader> ObjectArchive::header(std::size_t ahead) {
  const ByteSpan all = peek(ahead + kLongestName + 8);
  if (all.size() <= ahead) return std::nullopt;
  const ByteSpan bytes = all.subspan(ahead);
  const bool old = (bytes[0] & kNewFormat) == 0;
  const std::size_t length = bytes[0] & 0x7f, begin = old ? 4 : 1, version = old ? 4 : 1;
  if (length > kLongestName || begin + length + version > bytes.size()) return std::nullopt;
  if (old && (bytes[1] != 0 || bytes[2] != 0 || bytes[3] != 0)) return std::nullopt;
  const ByteSpan name = bytes.subspan(begin, length);
  if (!is_name(name)) return std::nullopt;
  ObjectHeader h;
  h.class_name.assign(name.begin(), name.end());
  h.version = bytes[begin + length];
  h.old = old;
  h.length = begin + length + version;
  return h;
}

std::size_t ObjectArchive::read(void* to, std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    if (at_ == buffer_.size()) fill();
    const std::size_t part = std::min(count - done, buffer_.size() - at_);
    if (part == 0) {
      ran_out_ = true;
      break;
    }
    std::memcpy(static_cast<std::uint8_t*>(to) + done, buffer_.data() + at_, part);
    skip(part);
    done += part;
  }
  return done;
}

std::size_t ObjectArchive::write(const void*, std::size_t) {
  return 0;
}

}  // namespace mapcodec
