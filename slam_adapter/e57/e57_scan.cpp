// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/e57/e57_scan.hpp"

#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <pugixml.hpp>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/e57/e57_pages.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kMostXml = std::uint64_t{32} << 20;  // nodes take many times their text

Error malformed(const std::string& what, std::optional<std::uint64_t> at = std::nullopt) {
  return make_error(ErrorCode::kMalformed, what, at);
}

/// A number in XML; an element without text is 0.
template <class T>
bool parse(const char* text, T& value) {
  std::string_view s(text);
  while (!s.empty() && (s.front() == ' ' || s.front() == '\n' || s.front() == '\t' || s.front() == '\r'))
    s.remove_prefix(1);
  if (s.starts_with('+')) s.remove_prefix(1);
  if (s.empty()) return true;
  const auto r = std::from_chars(s.data(), s.data() + s.size(), value);
  return r.ec == std::errc();
}

bool child_number(const pugi::xml_node& node, const char* name, double& value) {
  const pugi::xml_node child = node.child(name);
  return !child || (parse(child.text().get(), value) && std::isfinite(value));
}

bool read_pose(const pugi::xml_node& node, E57Scan& scan) {
  const pugi::xml_node pose = node.child("pose");
  const pugi::xml_node r = pose.child("rotation"), t = pose.child("translation");
  auto& q = scan.rotation_wxyz;
  if (r) q[0] = 0;
  if (!child_number(r, "w", q[0]) || !child_number(r, "x", q[1]) || !child_number(r, "y", q[2]) ||
      !child_number(r, "z", q[3]))
    return false;
  auto& p = scan.translation_m;
  if (!child_number(t, "x", p[0]) || !child_number(t, "y", p[1]) || !child_number(t, "z", p[2])) return false;
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 1e-6) || !std::isfinite(length)) return false;
  for (double& v : q) v /= length;
  scan.moved = !(q[1] == 0 && q[2] == 0 && q[3] == 0 && p == Vec3{0, 0, 0});
  return true;
}

Result<E57Field> read_field(const pugi::xml_node& node) {
  E57Field f;
  f.name = node.name();
  const std::string type = node.attribute("type").value();
  const auto broken = [&] {
    return malformed("describes the field " + f.name + " with numbers that are none");
  };
  if (type == "String") {
    f.kind = E57Field::Kind::text;
    return f;
  }
  if (type == "Float") {
    f.kind = std::string(node.attribute("precision").value()) == "single" ? E57Field::Kind::f32
                                                                          : E57Field::Kind::f64;
    return f;
  }
  if (type != "Integer" && type != "ScaledInteger")
    return make_error(ErrorCode::kUnsupported, "has points with the field " + f.name + " of type '" + type +
                                                   "'; numbers and text are known");
  f.kind = type == "Integer" ? E57Field::Kind::integer : E57Field::Kind::scaled;
  f.min = std::numeric_limits<std::int64_t>::min();
  f.max = std::numeric_limits<std::int64_t>::max();
  if (!parse(node.attribute("minimum").value(), f.min) || !parse(node.attribute("maximum").value(), f.max) ||
      !parse(node.attribute("scale").value(), f.scale) || !parse(node.attribute("offset").value(), f.offset))
    return broken();
  if (f.min > f.max || !std::isfinite(f.scale) || !std::isfinite(f.offset)) return broken();
  return f;
}

Result<E57Scan> read_scan(const pugi::xml_node& node, const pugi::xml_node& points) {
  E57Scan scan;
  scan.name = node.child("name").text().get();
  std::uint64_t at = 0;
  if (!parse(points.attribute("fileOffset").value(), at) ||
      !parse(points.attribute("recordCount").value(), scan.records))
    return malformed("describes a scan with numbers that are none");
  scan.section = E57Pages::logical(at);
  if (!read_pose(node, scan)) return malformed("describes a scan whose pose is none");
  for (const pugi::xml_node& child : points.child("prototype").children()) {
    if (child.type() != pugi::node_element) continue;
    MAPCODEC_ASSIGN(E57Field field, read_field(child));
    scan.fields.push_back(std::move(field));
    if (scan.fields.size() > 255)
      return make_error(ErrorCode::kUnsupported, "has points of more than 255 fields");
  }
  return scan;
}

/// Where the XML lies, from the 48 bytes that begin the file.
Result<std::string> read_xml(const ByteStream& file, const ByteStream& pages) {
  std::uint8_t head[48];
  MAPCODEC_ASSIGN(const std::size_t got, pages.read_at(0, head, sizeof(head)));
  if (got < sizeof(head))
    return make_error(ErrorCode::kTruncated, "ends within the first page of E57", file.size());
  ByteReader in(ByteSpan(head).subspan(8));
  const std::uint32_t major = in.u32();
  in.u32();
  const std::uint64_t bytes = in.u64(), at = in.u64(), length = in.u64(), page = in.u64();
  if (major != 1)
    return make_error(ErrorCode::kUnsupported, "is E57 of version " + std::to_string(major) + "; 1 is read",
                      8);
  if (page != E57Pages::kPage)
    return make_error(ErrorCode::kUnsupported,
                      "has pages of " + std::to_string(page) + " bytes; 1024 are read", 40);
  if (bytes > file.size())
    return make_error(
        ErrorCode::kTruncated,
        "announces " + std::to_string(bytes) + " bytes, but holds " + std::to_string(file.size()),
        file.size());
  const std::uint64_t from = E57Pages::logical(at);
  if (from > pages.size() || length > pages.size() - from)
    return make_error(ErrorCode::kTruncated, "has its description beyond the end", 24);
  if (length > kMostXml)
    return make_error(ErrorCode::kLimitExceeded, "has a description of more than 32 MiB");
  std::string xml(static_cast<std::size_t>(length), '\0');
  MAPCODEC_ASSIGN(const std::size_t read,
                  pages.read_at(from, reinterpret_cast<std::uint8_t*>(xml.data()), xml.size()));
  if (read < xml.size()) return make_error(ErrorCode::kTruncated, "has its description beyond the end", 24);
  return xml;
}

std::size_t count_children(const pugi::xml_node& node) {
  std::size_t n = 0;
  for (const pugi::xml_node& child : node.children()) n += child.type() == pugi::node_element ? 1 : 0;
  return n;
}

}  // namespace

unsigned E57Field::bits() const {
  if (kind == Kind::f32) return 32;
  if (kind == Kind::f64) return 64;
  return static_cast<unsigned>(
      std::bit_width(static_cast<std::uint64_t>(max) - static_cast<std::uint64_t>(min)));
}

const E57Field* E57Scan::find(const std::string& field) const {
  for (const E57Field& f : fields) {
    if (f.name == field) return &f;
  }
  return nullptr;
}

Result<E57Description> read_e57_description(const ByteStream& file, const ByteStream& pages) {
  MAPCODEC_ASSIGN(const std::string xml, read_xml(file, pages));
  pugi::xml_document document;
  const pugi::xml_parse_result parsed =
      document.load_buffer(xml.data(), xml.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!parsed) return malformed(std::string("has a description that is no XML: ") + parsed.description());
  const pugi::xml_node root = document.child("e57Root");
  if (!root) return malformed("has a description without e57Root");
  E57Description r;
  r.images = count_children(root.child("images2D"));
  for (const pugi::xml_node& node : root.child("data3D").children()) {
    const pugi::xml_node points = node.child("points");
    if (!points) continue;
    MAPCODEC_ASSIGN(E57Scan scan, read_scan(node, points));
    if (scan.records > 0) r.scans.push_back(std::move(scan));
  }
  if (r.scans.empty()) return make_error(ErrorCode::kEmpty, "holds no point (no scan of E57 has any)");
  return r;
}

}  // namespace mapcodec
