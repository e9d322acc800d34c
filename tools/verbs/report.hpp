// SPDX-License-Identifier: GPL-3.0-or-later
// What every verb says in the same way: failures, progress, the summary of a map, the summary of an
// evaluation.
#pragma once

#include <atomic>
#include <nlohmann/json.hpp>
#include <string>

#include "mapcodec/base/result.hpp"
#include "mapcodec/quality/evaluation.hpp"
#include "parallel/progress.hpp"
#include "slam_adapter/map_file.hpp"

namespace mapcodec::cli {

using Json = nlohmann::ordered_json;

enum ExitCode {
  kDone = 0,
  kDifference = 1,
  kUsage = 2,
  kBadInput = 3,
  kNoOutput = 4,
  kDamaged = 5,
  kUnreachable = 6,
  kInterrupted = 130
};
[[nodiscard]] int exit_code(ErrorCode code);

/// Prints `mapcodec: FILE: what is wrong (where)` on stderr, FILE left out where the message already names
/// it.
/// @return the exit code for the error.
int fail(const std::string& file, const Error& error);

/// Becomes true on SIGINT or SIGTERM (installed on first use); work then stops and cleans up.
[[nodiscard]] const std::atomic<bool>* stop_flag();

/// Draws progress on stderr in one of the styles of --progress (auto, bar, plain, json, none); auto draws a
/// bar on a terminal and nothing elsewhere.
[[nodiscard]] ProgressCallback progress_printer(const std::string& style);

[[nodiscard]] Json info_json(const MapFile& map);
void print_info(const MapFile& map);
[[nodiscard]] Json tiles_json(const MapFile& map);
[[nodiscard]] Json evaluation_json(const Evaluation& e, std::uint64_t bytes, std::uint64_t raw_bytes);
void print_evaluation(const Evaluation& e);

/// "1.23 MB".
[[nodiscard]] std::string human_bytes(std::uint64_t bytes);
/// "1,234,567".
[[nodiscard]] std::string human_count(std::uint64_t count);
/// Millimetres, three significant digits and a unit.
[[nodiscard]] std::string human_length(double metres);

/// Peak resident memory of this process so far [bytes].
[[nodiscard]] std::uint64_t peak_memory_bytes();

/// "2G", "512M", "1048576" -> bytes. InvalidArgument otherwise.
[[nodiscard]] Result<std::uint64_t> parse_size(const std::string& text);
/// "a,b,c" -> `count` numbers. InvalidArgument otherwise.
[[nodiscard]] Result<std::vector<double>> parse_numbers(const std::string& text, std::size_t count);

/// "x0,y0,z0,x1,y1,z1" [m]. InvalidArgument otherwise, and for a minimum above its maximum.
[[nodiscard]] Result<Box> parse_box(const std::string& text);
/// "x,y,z,r" [m]. InvalidArgument otherwise, and for a negative radius.
[[nodiscard]] Result<Region::Sphere> parse_sphere(const std::string& text);

[[nodiscard]] bool path_exists(const std::string& path);

/// Reads a cloud or a map, whole, with its file's and raw size.
struct LoadedCloud {
  PointCloud cloud;
  std::uint64_t bytes = 0;      ///< of the file
  std::uint64_t raw_bytes = 0;  ///< 12 per xyz plus channels
};
[[nodiscard]] Result<LoadedCloud> load_any(const std::string& path, Arena& arena);

}  // namespace mapcodec::cli
