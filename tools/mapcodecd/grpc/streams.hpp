// SPDX-License-Identifier: GPL-3.0-or-later
// The calls that are streams. Each function begins one; it lives until its client has the last answer.
#pragma once

#include "tools/mapcodecd/grpc/call.hpp"

namespace mapcodec::daemon {

using grpc::CallbackServerContext;

[[nodiscard]] grpc::ServerBidiReactor<v1::InsertRequest, v1::InsertReply>* begin_insert(
    CallContext& context, CallbackServerContext* grpc);
[[nodiscard]] grpc::ServerWriteReactor<v1::GetTilesReply>* begin_get_tiles(
    CallContext& context, CallbackServerContext* grpc, const v1::GetTilesRequest& request);
[[nodiscard]] grpc::ServerWriteReactor<v1::WatchReply>* begin_watch(CallContext& context,
                                                                    CallbackServerContext* grpc,
                                                                    const v1::WatchRequest& request);
[[nodiscard]] grpc::ServerWriteReactor<v1::DiffReply>* begin_diff(CallContext& context,
                                                                  CallbackServerContext* grpc,
                                                                  const v1::DiffRequest& request);
[[nodiscard]] grpc::ServerWriteReactor<v1::DecodeReply>* begin_decode(CallContext& context,
                                                                      CallbackServerContext* grpc,
                                                                      const v1::DecodeRequest& request);
[[nodiscard]] grpc::ServerWriteReactor<v1::ReadArchiveReply>* begin_read_archive(
    CallContext& context, CallbackServerContext* grpc, const v1::ReadArchiveRequest& request);
[[nodiscard]] grpc::ServerReadReactor<v1::UploadRequest>* begin_upload(CallContext& context,
                                                                       CallbackServerContext* grpc,
                                                                       v1::RevisionReply* reply);

}  // namespace mapcodec::daemon
