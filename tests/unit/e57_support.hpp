// SPDX-License-Identifier: GPL-3.0-or-later
// Writes E57 for tests.
#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

#include "mapcodec/base/crc32c.hpp"

namespace mapcodec::e57_test {

struct Field {
  std::string name, attributes;  ///< such as type="Integer" minimum="0" maximum="255"
  unsigned bits = 32;
  std::vector<std::uint64_t> raw;  ///< of each record
};
struct Scan {
  std::vector<Field> fields;
  std::string pose;  ///< XML
  std::uint64_t records = 0;
};

template <class T>
void put(std::string& to, T v) {
  to.append(reinterpret_cast<const char*>(&v), sizeof(T));
}
inline std::uint64_t bits_of(float v) {
  return std::bit_cast<std::uint32_t>(v);
}
inline std::uint64_t bits_of(double v) {
  return std::bit_cast<std::uint64_t>(v);
}

inline std::string packed(const Field& f) {
  std::string r;
  std::uint64_t at = 0;
  for (const std::uint64_t v : f.raw) {
    for (unsigned b = 0; b < f.bits; ++b, ++at) {
      if (at % 8 == 0) r.push_back('\0');
      if (v >> b & 1) r.back() = static_cast<char>(static_cast<unsigned char>(r.back()) | 1u << (at % 8));
    }
  }
  return r;
}

/// Packets that cut each stream into `pieces`, at other places in each.
inline std::string section(const Scan& scan, std::uint64_t logical_begin, std::size_t pieces) {
  std::vector<std::string> streams;
  for (const Field& f : scan.fields) streams.push_back(packed(f));
  std::string packets;
  for (std::size_t p = 0; p < pieces; ++p) {
    std::string packet, body;
    for (std::size_t s = 0; s < streams.size(); ++s) {
      const std::size_t size = streams[s].size(), begin = size * p / pieces, end = size * (p + 1) / pieces;
      put(packet, static_cast<std::uint16_t>(end - begin));
      body += streams[s].substr(begin, end - begin);
    }
    packet = std::string("\1\0\0\0\0\0", 6) + packet + body;
    while (packet.size() % 4 != 0) packet.push_back('\0');
    const auto length = static_cast<std::uint16_t>(packet.size() - 1),
               count = static_cast<std::uint16_t>(streams.size());
    std::memcpy(packet.data() + 2, &length, 2);
    std::memcpy(packet.data() + 4, &count, 2);
    packets += packet;
    if (p == 0) packets += std::string("\2\0\7\0\0\0\0\0", 8);  // an empty packet
  }
  std::string r(32, '\0');
  r[0] = 1;
  const std::uint64_t length = 32 + packets.size(), data = logical_begin + 32;
  const std::uint64_t physical = data / 1020 * 1024 + data % 1020;
  std::memcpy(r.data() + 8, &length, 8);
  std::memcpy(r.data() + 16, &physical, 8);
  return r + packets;
}

inline std::string paged(const std::string& logical) {
  std::string r;
  for (std::size_t at = 0; at < logical.size(); at += 1020) {
    std::string page = logical.substr(at, 1020);
    page.resize(1020, '\0');
    const std::uint32_t crc =
        crc32c(ByteSpan(reinterpret_cast<const std::uint8_t*>(page.data()), page.size()));
    for (int i = 3; i >= 0; --i) page.push_back(static_cast<char>(crc >> (8 * i)));
    r += page;
  }
  return r;
}

inline std::string write_e57(const std::vector<Scan>& scans, std::size_t pieces = 3,
                             const std::string& extra_xml = "") {
  std::string body(48, '\0');
  std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\"><data3D type=\"Vector\">";
  for (const Scan& scan : scans) {
    const std::uint64_t at = body.size();
    const std::uint64_t physical = at / 1020 * 1024 + at % 1020;
    body += section(scan, at, pieces);
    xml += "<vectorChild type=\"Structure\">" + scan.pose +
           "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(physical) +
           "\" recordCount=\"" + std::to_string(scan.records) + "\"><prototype>";
    for (const Field& f : scan.fields) xml += "<" + f.name + " " + f.attributes + "/>";
    xml += "</prototype></points></vectorChild>";
  }
  xml += "</data3D>" + extra_xml + "</e57Root>";
  const std::uint64_t xml_at = body.size();
  body += xml;
  const std::uint64_t size = (body.size() + 1019) / 1020 * 1024,
                      xml_physical = xml_at / 1020 * 1024 + xml_at % 1020, length = xml.size(), page = 1024;
  body.replace(0, 8, "ASTM-E57");
  const std::uint32_t version = 1;
  std::memcpy(body.data() + 8, &version, 4);
  std::memcpy(body.data() + 16, &size, 8);
  std::memcpy(body.data() + 24, &xml_physical, 8);
  std::memcpy(body.data() + 32, &length, 8);
  std::memcpy(body.data() + 40, &page, 8);
  return paged(body);
}

inline Field floats(const std::string& name, const std::vector<float>& values) {
  Field f{name, "type=\"Float\" precision=\"single\"", 32, {}};
  for (const float v : values) f.raw.push_back(bits_of(v));
  return f;
}
inline Field doubles(const std::string& name, const std::vector<double>& values) {
  Field f{name, "type=\"Float\"", 64, {}};
  for (const double v : values) f.raw.push_back(bits_of(v));
  return f;
}
inline Field integers(const std::string& name, std::int64_t min, std::int64_t max,
                      const std::vector<std::int64_t>& values) {
  Field f{name,
          "type=\"Integer\" minimum=\"" + std::to_string(min) + "\" maximum=\"" + std::to_string(max) + "\"",
          static_cast<unsigned>(std::bit_width(static_cast<std::uint64_t>(max - min))),
          {}};
  for (const std::int64_t v : values) f.raw.push_back(static_cast<std::uint64_t>(v - min));
  return f;
}
inline Field scaled(const std::string& name, const std::string& scale, const std::string& offset,
                    std::int64_t max, const std::vector<std::int64_t>& values) {
  Field f = integers(name, 0, max, values);
  f.attributes = "type=\"ScaledInteger\" minimum=\"0\" maximum=\"" + std::to_string(max) + "\" scale=\"" +
                 scale + "\" offset=\"" + offset + "\"";
  return f;
}

/// A hundred points with colour, intensity without bits, row, and a state that marks every tenth as none.
inline Scan colored_scan(std::size_t count = 100) {
  std::vector<float> x, y, z;
  std::vector<std::int64_t> red, row, state;
  for (std::size_t i = 0; i < count; ++i) {
    x.push_back(float(i) * 0.5f);
    y.push_back(-float(i));
    z.push_back(7);
    red.push_back(std::int64_t(i % 256));
    row.push_back(std::int64_t(i % 3));
    state.push_back(i % 10 == 9 ? 2 : 0);
  }
  Scan s;
  s.records = count;
  s.fields = {floats("cartesianX", x),
              floats("cartesianY", y),
              floats("cartesianZ", z),
              integers("intensity", 5, 5, std::vector<std::int64_t>(count, 5)),
              integers("colorRed", 0, 255, red),
              integers("colorGreen", 0, 255, red),
              integers("colorBlue", 0, 255, red),
              integers("rowIndex", 0, 2, row),
              integers("cartesianInvalidState", 0, 2, state)};
  return s;
}

}  // namespace mapcodec::e57_test
