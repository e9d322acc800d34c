// SPDX-License-Identifier: GPL-3.0-or-later
// The service over gRPC. No header of gRPC is needed to use this one.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "maps/service/access.hpp"
#include "maps/service/map_service.hpp"
#include "tools/mapcodecd/request_record.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// Threads: methods from one thread; calls are served by gRPC's.
class GrpcServer {
 public:
  /// Listens. @param service, access, metrics  must outlive the server.
  /// Errors: InvalidArgument (address; plain text beyond loopback), NotFound, Malformed (certificates),
  /// CannotWrite (address in use).
  [[nodiscard]] static Result<std::unique_ptr<GrpcServer>> start(const GrpcSettings& settings,
                                                                 MapService& service, AccessControl& access,
                                                                 ServiceMetrics& metrics,
                                                                 RecordRequest record = {});
  ~GrpcServer();

  /// What was bound, ports filled in.
  [[nodiscard]] const std::vector<std::string>& addresses() const;
  /// The health service says SERVING or NOT_SERVING.
  void set_serving(bool serving);
  /// Takes no new calls; those that run may end until `deadline`, then they are cut off. Waits.
  void stop(std::chrono::system_clock::time_point deadline);

 private:
  struct Impl;
  explicit GrpcServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace mapcodec::daemon
