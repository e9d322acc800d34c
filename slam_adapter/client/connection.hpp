// SPDX-License-Identifier: GPL-3.0-or-later
// What the client's sources share; the only header here that names gRPC.
#pragma once

#include <grpcpp/grpcpp.h>

#include "maps/service/v1/map_service.grpc.pb.h"
#include "slam_adapter/client/map_client.hpp"

namespace mapcodec {

struct MapClient::Connection {
  MapUrl url;
  ClientSettings settings;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::MapService::Stub> stub;

  /// Token and, with a time, deadline.
  void prepare(grpc::ClientContext& context, double timeout_s) const;
};

/// What the server said, as the library's error.
[[nodiscard]] Error error_of(const grpc::ClientContext& context, const grpc::Status& status,
                             const MapUrl& url);
[[nodiscard]] inline Status status_of(const grpc::ClientContext& context, const grpc::Status& status,
                                      const MapUrl& url) {
  return status.ok() ? Status() : Status(error_of(context, status, url));
}

}  // namespace mapcodec
