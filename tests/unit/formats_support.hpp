// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "slam_adapter/formats/formats.hpp"

namespace mapcodec::formats_test {

struct ReadBack {
  Status status;
  PointCloud cloud;
  std::uint64_t dropped = 0;
  std::vector<std::string> warnings;
};

inline ReadBack drain(Result<std::unique_ptr<PointSource>> source) {
  ReadBack r;
  if (!source.ok()) {
    r.status = source.error();
    return r;
  }
  r.cloud = (*source)->layout();
  PointCloud block;
  for (;;) {
    const auto more = (*source)->next(block);
    if (!more.ok()) r.status = more.error();
    if (!more.ok() || !*more) break;
    r.cloud.append(block);
  }
  r.dropped = (*source)->dropped_points();
  r.warnings = (*source)->warnings();
  return r;
}

inline ReadBack read_text(const std::string& text, const std::string& name = "cloud",
                          const ReadOptions& options = {}) {
  return drain(open_source_memory(ByteSpan(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()),
                                  name, options));
}

/// The error's code and that its message holds `part`.
inline bool fails_with(const ReadBack& r, ErrorCode code, const std::string& part) {
  return !r.status.ok() && r.status.error().code == code &&
         r.status.error().to_string().find(part) != std::string::npos;
}
inline std::string message(const ReadBack& r) {
  return r.status.ok() ? "no error" : r.status.error().to_string();
}

/// A folder of its own, gone with the object.
class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "mapcodec_formats_XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  [[nodiscard]] std::size_t files() const {
    const std::filesystem::directory_iterator all(path_);
    return static_cast<std::size_t>(std::distance(begin(all), end(all)));
  }

 private:
  std::string path_;
};

inline std::string file_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void write_bytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline Status write_cloud(const std::string& path, const PointCloud& cloud, const WriteOptions& options = {},
                          std::size_t block = 65536) {
  MAPCODEC_ASSIGN(auto sink, open_sink(path, cloud.like(), cloud.size(), options));
  for (std::size_t at = 0; at < cloud.size(); at += block) {
    PointCloud part = cloud.like();
    part.append(cloud, at, std::min(cloud.size(), at + block));
    MAPCODEC_TRY(sink->write(part));
  }
  return sink->finish();
}

}  // namespace mapcodec::formats_test
