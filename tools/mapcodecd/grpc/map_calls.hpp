// SPDX-License-Identifier: GPL-3.0-or-later
// The service of the .proto: each call goes to its stream, or to a thread of the pool.
#pragma once

#include "tools/mapcodecd/grpc/streams.hpp"

namespace mapcodec::daemon {

class MapCalls final : public v1::MapService::CallbackService {
 public:
  explicit MapCalls(CallContext& context) : context_(context) {}

  using Context = grpc::CallbackServerContext;
  using Unary = grpc::ServerUnaryReactor;

  Unary* CreateMap(Context*, const v1::CreateMapRequest*, v1::CreateMapReply*) override;
  Unary* ListMaps(Context*, const v1::ListMapsRequest*, v1::ListMapsReply*) override;
  Unary* DeleteMap(Context*, const v1::DeleteMapRequest*, v1::DeleteMapReply*) override;
  Unary* SetPoses(Context*, const v1::SetPosesRequest*, v1::RevisionReply*) override;
  Unary* Erase(Context*, const v1::EraseRequest*, v1::RevisionReply*) override;
  Unary* Snapshot(Context*, const v1::SnapshotRequest*, v1::RevisionReply*) override;
  Unary* Rollback(Context*, const v1::RollbackRequest*, v1::RevisionReply*) override;
  Unary* Compact(Context*, const v1::CompactRequest*, v1::CompactReply*) override;
  Unary* Stats(Context*, const v1::StatsRequest*, v1::StatsReply*) override;

  grpc::ServerBidiReactor<v1::InsertRequest, v1::InsertReply>* Insert(Context* c) override {
    return begin_insert(context_, c);
  }
  grpc::ServerWriteReactor<v1::GetTilesReply>* GetTiles(Context* c, const v1::GetTilesRequest* r) override {
    return begin_get_tiles(context_, c, *r);
  }
  grpc::ServerWriteReactor<v1::WatchReply>* Watch(Context* c, const v1::WatchRequest* r) override {
    return begin_watch(context_, c, *r);
  }
  grpc::ServerWriteReactor<v1::DecodeReply>* Decode(Context* c, const v1::DecodeRequest* r) override {
    return begin_decode(context_, c, *r);
  }
  grpc::ServerWriteReactor<v1::DiffReply>* Diff(Context* c, const v1::DiffRequest* r) override {
    return begin_diff(context_, c, *r);
  }
  grpc::ServerWriteReactor<v1::ReadArchiveReply>* ReadArchive(Context* c,
                                                              const v1::ReadArchiveRequest* r) override {
    return begin_read_archive(context_, c, *r);
  }
  grpc::ServerReadReactor<v1::UploadRequest>* Upload(Context* c, v1::RevisionReply* r) override {
    return begin_upload(context_, c, r);
  }

 private:
  CallContext& context_;
};

}  // namespace mapcodec::daemon
