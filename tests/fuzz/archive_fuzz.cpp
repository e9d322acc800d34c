// SPDX-License-Identifier: GPL-3.0-or-later
// Opens, reads and verifies a hostile archive. Two readings of the input: as a file; and, since random bytes
// rarely meet a checksum, as the index and metadata of a commit whose checksum is put right.
#include <algorithm>
#include <cstdlib>

#include "maps/commit_record.hpp"
#include "maps/map_archive.hpp"
#include "maps/map_writer.hpp"

namespace {

using namespace mapcodec;

void use(const MapArchive& archive) {
  for (const TileRecord& tile : archive.tiles()) {
    for (const SegmentRef& segment : tile.segments) (void)archive.read(segment);
  }
  (void)archive.tiles_in({{-1, -1, -1}, {1, 1, 1}});
  (void)archive.log();
  if (!archive.verify().ok()) std::abort();  // memory can always be read
}

void open(const Bytes& bytes) {
  const auto archive = MapArchive::open(std::make_unique<MemoryStore>(bytes));
  if (!archive.ok()) return;
  use(*archive);
  auto writer = MapWriter::open(std::make_unique<MemoryStore>(bytes));
  if (writer.ok() && !writer->commit(1).ok()) std::abort();  // what can be read can be written
}

/// If the input ends like an archive does, gives its last record the right checksum.
Bytes with_right_checksum(Bytes bytes) {
  if (bytes.size() < kHeaderBytes + kRecordBytes) return {};
  const auto header = archive_header();
  std::copy(header.begin(), header.end(), bytes.begin());
  const std::size_t offset = bytes.size() - kRecordBytes;
  const auto number = [&](std::size_t at) {
    std::uint32_t v = 0;
    for (std::size_t i = 4; i-- > 0;) v = v << 8 | bytes[offset + at + i];
    return v;
  };
  CommitRecord record;
  record.revision = 1;
  record.index_bytes = number(20);
  record.metadata_bytes = number(24);
  if (record.index_bytes == 0 || record.block_bytes() > offset - kHeaderBytes) return {};
  const ByteSpan blocks = ByteSpan(bytes).subspan(offset - record.block_bytes(), record.block_bytes());
  const auto tail = write_record(record, offset, blocks);
  std::copy(tail.begin(), tail.end(), bytes.begin() + static_cast<std::ptrdiff_t>(offset));
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes(data, data + size);
  open(bytes);
  open(with_right_checksum(bytes));
  return 0;
}
