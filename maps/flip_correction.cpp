// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/flip_correction.hpp"

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/crc32c.hpp"

namespace mapcodec {
namespace {

using Table = std::array<std::uint32_t, 256>;

constexpr Table make_table() {
  Table table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int bit = 0; bit < 8; ++bit) c = c >> 1 ^ (c & 1 ? 0x82F63B78u : 0u);
    table[i] = c;
  }
  return table;
}
constexpr Table kTable = make_table();

/// Which entry of the table has this high byte: each high byte occurs once.
constexpr std::array<std::uint8_t, 256> make_inverse() {
  std::array<std::uint8_t, 256> inverse{};
  for (std::uint32_t i = 0; i < 256; ++i) inverse[kTable[i] >> 24] = static_cast<std::uint8_t>(i);
  return inverse;
}
constexpr std::array<std::uint8_t, 256> kInverse = make_inverse();

/// Undoes the step of a CRC over one zero byte.
std::uint32_t step_back(std::uint32_t c) {
  const std::uint8_t i = kInverse[c >> 24];
  return (c ^ kTable[i]) << 8 | i;
}

constexpr std::uint64_t kFields = kRecordBytes - 4;  // before the record's checksum

std::uint32_t stored_crc(const Bytes& record) {
  ByteReader in(ByteSpan(record).last(4));
  return in.u32();
}

/// Where the blocks of the record begin, as its own fields say; nothing if they do not fit.
std::optional<std::uint64_t> blocks_begin(const Bytes& record, std::uint64_t offset) {
  ByteReader in(ByteSpan(record).subspan(20));
  const std::uint64_t index = in.u32(), length = index + in.u32();
  if (index == 0 || length > kMaxBlockBytes || offset < kHeaderBytes + length) return std::nullopt;
  return offset - length;
}

/// A wrong byte that is no field of lengths, or one of the blocks.
std::optional<Correction> correct_content(const TileStore& store, const Bytes& record, std::uint64_t offset) {
  const auto begin = blocks_begin(record, offset);
  if (!begin) return std::nullopt;
  const auto blocks = store.read(*begin, offset - *begin);
  if (!blocks.ok()) return std::nullopt;
  const std::uint64_t length = blocks->size() + kFields;
  const std::uint32_t actual = commit_crc(offset, *blocks, ByteSpan(record).first(kFields));
  const std::uint32_t wrong = actual ^ stored_crc(record);
  for (int byte = 0; byte < 4; ++byte) {  // the checksum itself
    const std::uint32_t one = wrong & 0xFFu << 8 * byte;
    if (wrong != 0 && one == wrong)
      return Correction{offset + kFields + static_cast<unsigned>(byte),
                        static_cast<std::uint8_t>(wrong >> 8 * byte)};
  }
  auto found = locate_flip(actual, stored_crc(record), length);
  if (found) found->offset += *begin;
  return found;
}

}  // namespace

std::optional<Correction> locate_flip(std::uint32_t actual, std::uint32_t stored, std::uint64_t length) {
  std::uint32_t c = actual ^ stored;
  if (c == 0) return std::nullopt;
  for (std::uint64_t at = length; at-- > 0;) {
    c = step_back(c);
    if (c < 256) return Correction{at, static_cast<std::uint8_t>(c)};
  }
  return std::nullopt;
}

std::optional<Correction> correct_commit(const TileStore& store, std::uint64_t offset) {
  const auto record = store.read(offset, kRecordBytes);
  if (!record.ok()) return std::nullopt;
  const auto succeeds = [&](const Correction& correction) {
    CorrectedStore corrected(store);
    corrected.add(correction);
    const auto commit = read_commit(corrected, offset);
    return commit.ok() && !commit->record.waypoint;
  };
  if (const auto found = correct_content(store, *record, offset); found && succeeds(*found)) return found;
  // With a wrong length it is unknown which bytes are the blocks: try them all.
  for (std::uint64_t at = 20; at < 28; ++at) {
    for (unsigned flip = 1; flip < 256; ++flip) {
      const Correction tried{offset + at, static_cast<std::uint8_t>(flip)};
      if (succeeds(tried)) return tried;
    }
  }
  return std::nullopt;
}

Result<Bytes> CorrectedStore::read(std::uint64_t offset, std::uint64_t length) const {
  MAPCODEC_ASSIGN(Bytes bytes, store_.read(offset, length));
  for (const Correction& c : corrections_) {
    if (c.offset >= offset && c.offset - offset < length) bytes[c.offset - offset] ^= c.flip;
  }
  return bytes;
}

}  // namespace mapcodec
