// SPDX-License-Identifier: GPL-3.0-or-later
// Built without the client of services.
#include "tools/verbs/remote.hpp"

namespace mapcodec::cli {
namespace {
Error none() {
  return make_error(ErrorCode::kUnsupported, "this mapcodec was built without its client of services");
}
}  // namespace

void use_services() {}
bool is_remote(const std::string& map) {
  return map.rfind("mapcodec://", 0) == 0;
}
Result<UpdateReport> update_remote(const std::string&, const UpdateRequest&, std::vector<std::string>&) {
  return none();
}
Result<UpdateReport> merge_remote(const std::string&, const MergeRequest&, std::vector<std::string>&) {
  return none();
}
Result<UpdateReport> erase_remote(const std::string&, const std::optional<Erasure>&, const std::string&) {
  return none();
}
Result<std::uint64_t> set_poses_remote(const std::string&,
                                       const std::vector<std::pair<std::string, PoseChange>>&) {
  return none();
}
Result<std::uint64_t> snapshot_remote(const std::string&, const std::string&, bool) {
  return none();
}
Result<std::uint64_t> rollback_remote(const std::string&, const std::string&) {
  return none();
}
Result<CompactReport> compact_remote(const std::string&, std::uint64_t) {
  return none();
}
Result<CompressReport> compress_remote(const std::vector<std::string>&, const std::string&, CompressOptions) {
  return none();
}

}  // namespace mapcodec::cli
