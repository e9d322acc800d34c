// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/writer_table.hpp"

#include <algorithm>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"

namespace mapcodec {

WriterTable WriterTable::read(const MapInfo& info) {
  WriterTable table;
  const auto extra = info.extras.find(kWritersExtra);
  if (extra == info.extras.end()) return table;
  ByteReader in(extra->second);
  const std::uint64_t count = in.varint();
  if (!in.ok() || count > kMaxWriters) return {};
  for (std::uint64_t i = 0; i < count; ++i) {
    Entry entry;
    entry.writer = in.text();
    entry.sequence = in.varint();
    if (entry.writer.size() > kMaxWriterName) return {};
    table.entries_.push_back(std::move(entry));
  }
  return in.ok() && in.left() == 0 ? table : WriterTable();
}

Bytes WriterTable::write() const {
  ByteWriter out;
  out.varint(entries_.size());
  for (const Entry& e : entries_) {
    out.text(e.writer);
    out.varint(e.sequence);
  }
  return out.take();
}

std::uint64_t WriterTable::last(const std::string& writer) const {
  const auto at =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.writer == writer; });
  return at == entries_.end() ? 0 : at->sequence;
}

void WriterTable::set(const std::string& writer, std::uint64_t sequence) {
  std::erase_if(entries_, [&](const Entry& e) { return e.writer == writer; });
  entries_.push_back({writer, sequence});
  if (entries_.size() > kMaxWriters) entries_.pop_front();
}

}  // namespace mapcodec
