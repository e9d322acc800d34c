// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cmath>
#include <cstring>

#include "mapcodec/base/byte_reader.hpp"
#include "slam_adapter/formats/detect.hpp"
#include "slam_adapter/formats/text_number.hpp"
#include "slam_adapter/octomap/octree_file.hpp"

namespace mapcodec {
namespace {

constexpr std::string_view kBinaryMagic = "# Octomap OcTree binary file";
constexpr std::string_view kFullMagic = "# Octomap OcTree file";
constexpr std::uint64_t kMostNodes = std::uint64_t{1} << 31;

struct Header {
  bool binary = false;
  OccupancyKind kind = OccupancyKind::binary;
  std::uint64_t nodes = 0;
  double resolution_m = 0;
};

Error malformed(const std::string& what, std::uint64_t offset) {
  return make_error(ErrorCode::kMalformed, "octree: " + what, offset);
}

/// Words and lines of the header, as OctoMap's `operator>>` sees them.
class HeaderText {
 public:
  explicit HeaderText(ByteSpan bytes)
      : text_(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), kMostHeader)) {
  }

  std::string_view word() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
    const std::size_t begin = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  void end_line() {
    while (at_ < text_.size() && text_[at_] != '\n') ++at_;
    at_ += at_ < text_.size() ? 1 : 0;
  }
  [[nodiscard]] std::size_t offset() const { return at_; }

 private:
  static constexpr std::size_t kMostHeader = 65536;
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  std::string_view text_;
  std::size_t at_ = 0;
};

Result<OccupancyKind> kind_of(std::string_view id, bool binary) {
  if (id == "OcTree") return binary ? OccupancyKind::binary : OccupancyKind::log_odds;
  if (id == "ColorOcTree") return binary ? OccupancyKind::binary : OccupancyKind::color;
  return make_error(ErrorCode::kUnsupported, "octree: trees of kind '" + std::string(id.substr(0, 40)) +
                                                 "' are not read, only OcTree and ColorOcTree");
}

Status check(const Header& h, std::size_t offset) {
  if (!(h.resolution_m > 0) || !std::isfinite(h.resolution_m))
    return malformed("its header has no resolution above 0", offset);
  if (h.nodes == 0) return make_error(ErrorCode::kEmpty, "octree: holds no node");
  if (h.nodes > kMostNodes) return make_error(ErrorCode::kLimitExceeded, "octree: too many nodes");
  return {};
}

Result<Header> read_header(HeaderText& text, bool binary) {
  Header h;
  h.binary = binary;
  std::string_view id;
  text.end_line();
  for (;;) {
    const std::string_view word = text.word();
    if (word.empty()) return malformed("its header has no end", text.offset());
    if (word == "data") break;
    bool good = true;
    if (word == "id") {
      id = text.word();
    } else if (word == "res") {
      good = parse_number(text.word(), h.resolution_m);
    } else if (word == "size") {
      double nodes = 0;
      good = parse_number(text.word(), nodes) && nodes >= 0 && nodes <= double(kMostNodes);
      h.nodes = good ? static_cast<std::uint64_t>(nodes) : 0;
    } else {
      text.end_line();
    }
    if (!good) return malformed("its header has a broken number", text.offset());
  }
  text.end_line();
  if (id.empty()) return malformed("its header names no kind of tree", text.offset());
  MAPCODEC_ASSIGN(h.kind, kind_of(id, binary));
  MAPCODEC_TRY(check(h, text.offset()));
  return h;
}

/// Depth first, each node appended to its level: this is the levels' order.
class NodeReader {
 public:
  NodeReader(ByteSpan bytes, std::uint64_t offset, const Header& header)
      : in_(bytes.data()), end_(bytes.data() + bytes.size()), base_(offset), header_(header) {
    tree_.kind = header.kind;
  }

  Result<OccupancyTree> run() {
    const bool good = header_.binary ? read_binary_root() : read_full(kOccupancyHeight, tree_.root);
    if (!good) {
      if (deep_) return malformed("it is deeper than 16 levels", offset());
      return make_error(ErrorCode::kTruncated, "octree ends too early", offset());
    }
    if (count_ != header_.nodes) {
      return malformed(
          "it has " + std::to_string(count_) + " nodes, its header says " + std::to_string(header_.nodes),
          offset());
    }
    if (tree_.root == Cell::unknown) return make_error(ErrorCode::kEmpty, "octree: holds no leaf");
    return std::move(tree_);
  }

 private:
  [[nodiscard]] std::uint64_t offset() const { return base_ + static_cast<std::uint64_t>(in_ - start_); }
  [[nodiscard]] bool has(std::size_t count) const { return static_cast<std::size_t>(end_ - in_) >= count; }

  bool read_binary_root() {
    count_ = 1;
    return read_binary(kOccupancyHeight, tree_.root);
  }

  // A node's two bytes are, as they stand, what a level keeps: bits 10 mean free, 01 occupied, 11 inner.
  bool read_binary(unsigned height, Cell& cell) {
    if (!has(2)) return false;
    auto node = static_cast<std::uint32_t>(in_[0] | in_[1] << 8);
    in_ += 2;
    count_ += static_cast<std::uint64_t>(std::popcount((node | node >> 1) & 0x5555u));
    if (height == 1 && inner_bits(node) != 0) return !(deep_ = true);
    std::vector<std::uint16_t>& nodes = tree_.levels[height].nodes;
    const std::size_t own = nodes.size();
    nodes.push_back(static_cast<std::uint16_t>(node));
    for (std::uint32_t left = inner_bits(node); left != 0; left &= left - 1) {
      const auto child = static_cast<unsigned>(std::countr_zero(left)) / 2;
      Cell below = Cell::inner;
      if (!read_binary(height - 1, below)) return false;
      node = (node & ~(3u << (2 * child))) | static_cast<std::uint32_t>(below) << (2 * child);
    }
    cell = node != 0 ? Cell::inner : (height == kOccupancyHeight ? Cell::unknown : Cell::free);
    nodes[own] = static_cast<std::uint16_t>(node);
    return true;
  }

  bool read_full(unsigned height, Cell& cell) {
    const bool colored = header_.kind == OccupancyKind::color;
    if (!has(colored ? 8 : 5)) return false;
    std::uint32_t value = 0;
    for (unsigned i = 0; i < 4; ++i) value |= std::uint32_t{in_[i]} << (8 * i);
    in_ += 4;
    OccupancyColor color = kNoColor;
    if (colored) {
      color = {in_[0], in_[1], in_[2]};
      in_ += 3;
    }
    const std::uint32_t mask = *in_++;
    ++count_;
    OccupancyLevel& level = tree_.levels[height];
    cell = mask == 0 ? cell_of_value(value) : Cell::inner;
    (mask == 0 ? level.leaf_values : level.node_values).push_back(value);
    if (colored) (mask == 0 ? level.leaf_colors : level.node_colors).push_back(color);
    return mask == 0 || read_children(height, mask);
  }

  bool read_children(unsigned height, std::uint32_t mask) {
    if (height == 0) return !(deep_ = true);
    std::vector<std::uint16_t>& nodes = tree_.levels[height].nodes;
    const std::size_t own = nodes.size();
    nodes.push_back(0);
    std::uint32_t node = 0;
    for (unsigned i = 0; i < 8; ++i) {
      Cell below = Cell::unknown;
      if ((mask >> i & 1) != 0 && !read_full(height - 1, below)) return false;
      node |= static_cast<std::uint32_t>(below) << (2 * i);
    }
    nodes[own] = static_cast<std::uint16_t>(node);
    return true;
  }

  const std::uint8_t* in_;
  const std::uint8_t* const start_ = in_;
  const std::uint8_t* end_;
  std::uint64_t base_;
  const Header& header_;
  OccupancyTree tree_;
  std::uint64_t count_ = 0;
  bool deep_ = false;
};

/// Nodes that had no child are leaves of their parents: their places among the inner nodes go.
void drop_childless(OccupancyTree& tree) {
  for (OccupancyLevel& l : tree.levels) std::erase(l.nodes, std::uint16_t{0});
}

/// Before OctoMap 1.0: the number 3, the resolution, the number of nodes.
Result<Header> read_old_header(ByteReader& in) {
  Header h;
  h.binary = true;
  const std::uint32_t type = in.u32();
  h.resolution_m = in.f64();
  h.nodes = in.u32();
  if (!in.ok() || type != 3)
    return malformed("it begins neither as a file of OctoMap's nor as an old .bt", 0);
  MAPCODEC_TRY(check(h, in.offset()));
  return h;
}

Result<Bytes> load(const std::string& path) {
  MAPCODEC_ASSIGN(const std::unique_ptr<ByteStream> stream, file_stream(path));
  Bytes bytes(stream->size());
  MAPCODEC_ASSIGN(const std::size_t count, stream->read_at(0, bytes.data(), bytes.size()));
  bytes.resize(count);
  return bytes;
}

}  // namespace

Result<OctreeFile> parse_octree(ByteSpan bytes, const DecodeLimits& limits) {
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()),
                              std::min<std::size_t>(bytes.size(), 64));
  if (bytes.empty()) return make_error(ErrorCode::kEmpty, "octree: the file is empty");
  const bool binary = head.starts_with(kBinaryMagic);
  Header header;
  std::size_t begin = 0;
  if (binary || head.starts_with(kFullMagic)) {
    HeaderText text(bytes);
    MAPCODEC_ASSIGN(header, read_header(text, binary));
    begin = text.offset();
  } else {
    ByteReader in(bytes);
    MAPCODEC_ASSIGN(header, read_old_header(in));
    begin = in.offset();
  }
  // Two bytes of a .bt make up to eight nodes; a node of an .ot takes at least five.
  const std::uint64_t rest = bytes.size() - begin;
  const std::uint64_t most = header.binary ? 4 * rest + 1 : rest / 5;
  if (header.nodes > most)
    return make_error(ErrorCode::kTruncated, "octree has fewer bytes than its header's number of nodes needs",
                      begin);
  if (header.nodes * 24 > limits.max_bytes)
    return make_error(ErrorCode::kLimitExceeded, "octree would need too much memory");
  OctreeFile file;
  MAPCODEC_ASSIGN(file.tree, NodeReader(bytes.subspan(begin), begin, header).run());
  if (header.binary) drop_childless(file.tree);
  file.resolution_m = header.resolution_m;
  file.bytes = bytes.size();
  return file;
}

Result<OctreeFile> read_octree(const std::string& path, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(const Bytes bytes, load(path));
  return parse_octree(bytes, limits);
}

bool is_octree_file(const std::string& path) {
  const auto stream = file_stream(path);
  if (!stream.ok()) return false;
  const Format format = recognise(**stream, path);
  return format == Format::octomap_bt || format == Format::octomap_ot;
}

bool is_octree_name(const std::string& path) {
  const std::string extension = extension_of(path);
  return extension == ".bt" || extension == ".ot";
}

}  // namespace mapcodec
