// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/client/remote_store.hpp"

#include <list>
#include <mutex>

#include "maps/store_schemes.hpp"
#include "slam_adapter/client/connection.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kBlock = std::uint64_t{1} << 16;
constexpr std::size_t kBlocks = 128;

class RemoteStore final : public TileStore {
 public:
  explicit RemoteStore(const MapClient& client) : connection_(client.connection()) {}

  Status open() {
    v1::ReadArchiveReply first;
    MAPCODEC_TRY(fetch(0, 1, &first));
    file_ = first.file();
    size_ = first.file_bytes();
    return {};
  }

  [[nodiscard]] Result<SegmentRef> append(ByteSpan) override { return read_only(); }
  [[nodiscard]] Status publish(ByteSpan) override { return read_only(); }
  [[nodiscard]] Status discard_after(std::uint64_t) override { return read_only(); }
  [[nodiscard]] Result<std::uint64_t> end() const override { return size_; }
  [[nodiscard]] std::uint64_t bytes_read() const override { return bytes_read_; }

  [[nodiscard]] Result<Bytes> read(std::uint64_t offset, std::uint64_t length) const override {
    if (offset > size_ || length > size_ - offset)
      return make_error(ErrorCode::kTruncated, "ends before what was asked for", offset);
    if (length == 0) return Bytes();
    if (length >= kBlock) return fetch(offset, length, nullptr);
    Bytes bytes;
    while (length > 0) {
      MAPCODEC_ASSIGN(const auto block, block_of(offset / kBlock));
      const std::uint64_t in = offset % kBlock, take = std::min<std::uint64_t>(length, block->size() - in);
      bytes.insert(bytes.end(), block->begin() + std::ptrdiff_t(in),
                   block->begin() + std::ptrdiff_t(in + take));
      offset += take;
      length -= take;
    }
    return bytes;
  }

 private:
  using Block = std::shared_ptr<const Bytes>;

  static Error read_only() {
    return make_error(ErrorCode::kCannotWrite, "the archive of a service is changed by its calls only");
  }

  Result<Block> block_of(std::uint64_t number) const {
    {
      const std::lock_guard lock(mutex_);
      for (auto at = blocks_.begin(); at != blocks_.end(); ++at) {
        if (at->first != number) continue;
        blocks_.splice(blocks_.begin(), blocks_, at);
        return blocks_.front().second;
      }
    }
    const std::uint64_t begin = number * kBlock;
    MAPCODEC_ASSIGN(Bytes bytes, fetch(begin, std::min(kBlock, size_ - begin), nullptr));
    auto block = std::make_shared<const Bytes>(std::move(bytes));
    const std::lock_guard lock(mutex_);
    blocks_.emplace_front(number, block);
    if (blocks_.size() > kBlocks) blocks_.pop_back();
    return block;
  }

  Result<Bytes> fetch(std::uint64_t offset, std::uint64_t length, v1::ReadArchiveReply* first) const {
    grpc::ClientContext context;
    connection_->prepare(context, connection_->settings.job_timeout_s);
    v1::ReadArchiveRequest request;
    request.set_map(connection_->url.map);
    request.set_file(file_);
    request.set_offset(offset);
    request.set_length(length);
    const auto reader = connection_->stub->ReadArchive(&context, request);
    Bytes bytes;
    v1::ReadArchiveReply reply;
    for (bool begun = false; reader->Read(&reply); begun = true) {
      if (!begun && first != nullptr) *first = reply;
      bytes.insert(bytes.end(), reply.data().begin(), reply.data().end());
    }
    MAPCODEC_TRY(status_of(context, reader->Finish(), connection_->url));
    if (bytes.size() != length)
      return make_error(ErrorCode::kTruncated, "the server sent less than was asked for");
    bytes_read_ += bytes.size();
    return bytes;
  }

  std::shared_ptr<MapClient::Connection> connection_;
  std::uint64_t file_ = 0, size_ = 0;
  mutable std::atomic<std::uint64_t> bytes_read_{0};
  mutable std::mutex mutex_;
  mutable std::list<std::pair<std::uint64_t, Block>> blocks_;
};

}  // namespace

Result<std::unique_ptr<TileStore>> open_remote_store(const MapClient& client) {
  auto store = std::make_unique<RemoteStore>(client);
  MAPCODEC_TRY(store->open());
  return std::unique_ptr<TileStore>(std::move(store));
}

void register_map_scheme() {
  register_store_scheme(kMapScheme, [](const std::string& place) -> Result<std::unique_ptr<TileStore>> {
    MAPCODEC_ASSIGN(const MapClient client, MapClient::connect(place));
    if (client.url().map.empty())
      return make_error(ErrorCode::kInvalidArgument, "'" + place + "' names no map");
    return open_remote_store(client);
  });
}

}  // namespace mapcodec
