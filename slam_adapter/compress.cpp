// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/compress.hpp"

#include <algorithm>
#include <filesystem>

#include "slam_adapter/compress_job.hpp"
#include "slam_adapter/formats/formats.hpp"
#include "slam_adapter/octomap/octree_jobs.hpp"
#include "slam_adapter/order_source.hpp"
#include "slam_adapter/schema_choice.hpp"

namespace mapcodec {
namespace {

Error with_file(const std::string& path, const Error& e) {
  if (e.message.find(path) != std::string::npos) return e;
  return make_error(e.code, path + ": " + e.message, e.offset);
}

Result<std::unique_ptr<PointSource>> open_inputs(const std::vector<std::string>& inputs,
                                                 const ReadOptions& options, bool every_channel) {
  std::vector<std::unique_ptr<PointSource>> sources;
  for (const std::string& path : inputs) {
    MAPCODEC_ASSIGN(std::unique_ptr<PointSource> source, open_source(path, options));
    sources.push_back(std::move(source));
  }
  if (sources.size() == 1) return std::move(sources.front());
  return concatenate(std::move(sources), every_channel);
}

}  // namespace

Result<CompressReport> compress(PointSource& source, const std::string& path,
                                const CompressOptions& options) {
  MAPCODEC_TRY(check_numbers(options));
  if (!options.keep_order) return CompressJob(source, path, options).run();
  OrderSource ordered(source);
  return CompressJob(ordered, path, options).run();
}

Result<CompressReport> compress_files(const std::vector<std::string>& inputs, const std::string& path,
                                      CompressOptions options) {
  MAPCODEC_TRY(check_numbers(options));
  std::error_code ignored;
  if (!options.overwrite && std::filesystem::exists(path, ignored)) {
    return make_error(ErrorCode::kCannotWrite, path + ": exists already (--force replaces it)");
  }
  if (std::all_of(inputs.begin(), inputs.end(), is_octree_file))
    return compress_octrees(inputs, path, options);
  ReadOptions read;
  read.keep_nonfinite = options.promise == PromiseKind::lossless;
  read.unit_m = options.unit_m;
  read.bag = options.bag;
  MAPCODEC_ASSIGN(const std::unique_ptr<PointSource> source,
                  open_inputs(inputs, read, options.promise == PromiseKind::lossless));
  for (const std::string& input : inputs) {
    MAPCODEC_ASSIGN(const std::uint64_t bytes, input_bytes(input));
    options.input_bytes += bytes;
  }
  auto report = compress(*source, path, options);
  if (!report.ok() && report.error().code == ErrorCode::kCannotWrite) return with_file(path, report.error());
  return report;
}

}  // namespace mapcodec
