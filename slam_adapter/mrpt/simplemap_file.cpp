// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/mrpt/simplemap_file.hpp"

#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <map>

#include "slam_adapter/formats/byte_stream.hpp"
#include "slam_adapter/formats/file_sink.hpp"
#include "slam_adapter/mrpt/reader_process.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kWriterMemory = std::uint64_t{8} << 30;  // address space
constexpr double kPatience = 600;                                // [s] for the last keyframe to be zipped

/// Where MRPT's writer writes, until all of it is there.
class Scratch {
 public:
  explicit Scratch(const std::string& target) : path_(target + ".part" + std::to_string(::getpid())) {}
  ~Scratch() { ::unlink(path_.c_str()); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

  /// Through a file that syncs and renames as all outputs do.
  Status move_to(const std::string& target) const {
    MAPCODEC_ASSIGN(const std::unique_ptr<ByteStream> from, file_stream(path_));
    OutputFile to;
    MAPCODEC_TRY(to.open(target));
    Bytes block(1 << 20);
    for (std::uint64_t at = 0; at < from->size();) {
      MAPCODEC_ASSIGN(const std::size_t got, from->read_at(at, block.data(), block.size()));
      if (got == 0) return make_error(ErrorCode::kCannotWrite, path_ + ": ends too early");
      MAPCODEC_TRY(to.append(ByteSpan(block).first(got)));
      at += got;
    }
    return to.commit();
  }

 private:
  std::string path_;
};

Result<RawlogFrame> keyframe_of(const MapFile& map, std::uint32_t submap,
                                const std::vector<std::size_t>& tiles, const ReadSettings& settings) {
  RawlogFrame frame;
  frame.points = map.schema().layout();
  for (const std::size_t i : tiles) {
    if (settings.stop != nullptr && *settings.stop) return make_error(ErrorCode::kCancelled, "stopped");
    MAPCODEC_ASSIGN(const PointCloud tile, map.read_tile_in_submap(i, settings.limits));
    frame.points.append(tile);
  }
  MapPose pose;
  if (submap < map.archive().info().submaps.size()) {
    const Submap& s = map.archive().info().submaps[submap];
    pose = {s.translation_m, s.rotation_xyzw};
    frame.sensor = s.name;
    if (s.first_stamp_s > 0) frame.stamp_s = s.first_stamp_s;
  }
  frame.T_map_vehicle = pose;
  return frame;
}

Status finish(MessagePipe& writer) {
  writer.end_writing();
  MAPCODEC_ASSIGN(const MessagePipe::Message m, writer.read(kPatience));
  if (m.kind == WireKind::error) return read_error(m.payload);
  return {};
}

}  // namespace

bool is_simplemap_name(const std::string& path) {
  return path.ends_with(".simplemap") || path.ends_with(".simplemap.gz");
}

Result<DecompressReport> decompress_simplemap(const std::string& map_path, const std::string& path,
                                              std::optional<std::uint64_t> revision,
                                              const ReadSettings& settings) {
  const auto begin = std::chrono::steady_clock::now();
  DecompressReport report;
  MAPCODEC_ASSIGN(const MapFile map, MapFile::open(map_path, revision));
  std::map<std::uint32_t, std::vector<std::size_t>> submaps;
  for (std::size_t i = 0; i < map.archive().tiles().size(); ++i)
    submaps[map.archive().tiles()[i].submap].push_back(i);
  if (submaps.empty()) return make_error(ErrorCode::kEmpty, "holds no point");
  const Scratch scratch(path);
  MAPCODEC_ASSIGN(MessagePipe writer,
                  start_mrpt_program({"write", scratch.path(), "--keyframes", std::to_string(submaps.size()),
                                      "--memory", std::to_string(kWriterMemory)}));
  for (const auto& [submap, tiles] : submaps) {
    MAPCODEC_ASSIGN(const RawlogFrame frame, keyframe_of(map, submap, tiles, settings));
    report.points += frame.points.size();
    // The writer ends at the first error: what it says of it is worth more than that it is gone.
    if (!writer.write(write_message(WireKind::frame, write_frame(frame))).ok()) break;
    if (settings.progress)
      settings.progress({"decode", report.tiles_read += tiles.size(), map.archive().tiles().size(), 0});
  }
  MAPCODEC_TRY(finish(writer));
  MAPCODEC_TRY(scratch.move_to(path));
  report.tiles_read = map.archive().tiles().size();
  report.bytes_read = map.archive().bytes_read();
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return report;
}

}  // namespace mapcodec
