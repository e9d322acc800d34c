// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/rawlog_reader.hpp"

#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/record_source.hpp"
#include "slam_adapter/mrpt/reader_process.hpp"

namespace mapcodec {

struct RawlogReader::State {
  std::string path;
  MessagePipe pipe;
  std::uint64_t file_bytes = 0;
  RawlogSummary summary;
  bool ended = false;
  Status failed;

  Result<std::optional<RawlogFrame>> next() {
    if (ended) return std::optional<RawlogFrame>{};
    MAPCODEC_ASSIGN(const MessagePipe::Message m, pipe.read());
    if (m.kind == WireKind::error) return read_error(m.payload);
    if (m.kind == WireKind::frame) {
      MAPCODEC_ASSIGN(RawlogFrame frame, read_frame(m.payload));
      return std::optional<RawlogFrame>(std::move(frame));
    }
    MAPCODEC_ASSIGN(summary, read_summary(m.payload));
    ended = true;
    return std::optional<RawlogFrame>{};
  }
};

namespace {

std::vector<std::string> words(const std::string& path, const RawlogOptions& o) {
  std::vector<std::string> w{"read",         path,
                             "--skip",       std::to_string(o.skip),
                             "--decimation", std::to_string(o.decimation),
                             "--memory",     std::to_string(o.memory_bytes)};
  if (o.list) w.emplace_back("--list");
  if (o.match_scans) w.emplace_back("--match-scans");
  for (const std::string& s : o.sensors) {
    w.emplace_back("--sensor");
    w.push_back(s);
  }
  return w;
}

}  // namespace

RawlogReader::RawlogReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
RawlogReader::RawlogReader(RawlogReader&&) noexcept = default;
RawlogReader& RawlogReader::operator=(RawlogReader&&) noexcept = default;
RawlogReader::~RawlogReader() = default;

Result<RawlogReader> RawlogReader::open(const std::string& path, const RawlogOptions& options) {
  auto stream = file_stream(path);
  if (!stream.ok()) return named(path, stream.error());
  const std::uint64_t bytes = (*stream)->size();
  if (bytes == 0) return named(path, make_error(ErrorCode::kEmpty, "is empty (0 bytes)"));
  auto pipe = start_mrpt_program(words(path, options));
  if (!pipe.ok()) return named(path, pipe.error());
  return RawlogReader(std::unique_ptr<State>(new State{path, std::move(*pipe), bytes, {}, false, {}}));
}

Result<std::optional<RawlogFrame>> RawlogReader::next() {
  if (!state_->failed.ok()) return state_->failed.error();
  auto frame = state_->next();
  if (!frame.ok()) {
    state_->failed = named(state_->path, frame.error());
    return state_->failed.error();
  }
  return frame;
}

const RawlogSummary& RawlogReader::summary() const {
  return state_->summary;
}
std::uint64_t RawlogReader::file_bytes() const {
  return state_->file_bytes;
}

std::vector<std::string> unused_classes(const RawlogSummary& summary) {
  std::vector<std::string> said;
  for (const RawlogClass& c : summary.classes) {
    if (!c.remark.empty()) said.push_back(std::to_string(c.count) + " " + c.name + ": " + c.remark);
  }
  return said;
}

}  // namespace mapcodec
