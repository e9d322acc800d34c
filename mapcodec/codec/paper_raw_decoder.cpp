// SPDX-License-Identifier: GPL-3.0-or-later
// The raw form: floats, as the paper stored them.
#include <cmath>
#include <string>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/codec/paper_content.hpp"
#include "mapcodec/codec/paper_sections.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec::paper {
namespace {

class RawReader {
 public:
  RawReader(ByteSpan bytes, const MapSchema& schema) : in_(bytes), channel_(color_channel(schema)) {
    if (channel_ != kNoColor) info_ = &schema.channels[channel_].info;
    as_f32_ = schema.coordinates.kind == CoordinateFormat::Kind::f32;
  }

  Result<Content> read(std::uint64_t count) {
    Content c;
    for (double& x : corner_) x = in_.f64();
    const std::uint32_t planes = in_.u32();
    MAPCODEC_TRY(in_.status("paper: raw header"));
    if (planes > in_.left() / 12) return truncated();
    std::uint64_t left = count;
    for (std::uint32_t i = 0; i < planes; ++i) MAPCODEC_TRY(read_plane(c.patches.emplace_back(), left));
    MAPCODEC_TRY(read_rest(c, left));
    return c;
  }

 private:
  [[nodiscard]] std::size_t color_bytes() const { return info_ != nullptr ? info_->stride() : 0; }
  [[nodiscard]] Error truncated() const {
    return make_error(ErrorCode::kTruncated, "paper: more is announced than there are bytes", in_.offset());
  }
  [[nodiscard]] Error malformed(const char* what) const {
    return make_error(ErrorCode::kMalformed, std::string("paper: ") + what, in_.offset());
  }
  Vec3 read_position() {
    Vec3 p;
    for (std::size_t d = 0; d < 3; ++d) p[d] = corner_[d] + static_cast<double>(in_.f32());
    return p;
  }

  Status read_plane(PlanarPatch& patch, std::uint64_t& left) {
    patch.points = in_.u32();
    const float area = in_.f32();
    const std::uint32_t triangles = in_.u32();
    MAPCODEC_TRY(in_.status("paper: plane"));
    if (!std::isfinite(area) || triangles == 0) return malformed("a plane without triangles");
    if (patch.points == 0 || patch.points > left) return malformed("planes have more points than the tile");
    if (triangles > in_.left() / (36 + color_bytes())) return truncated();
    left -= patch.points;
    for (std::uint32_t t = 0; t < triangles; ++t) read_triangle(patch);
    for (const Vec3& v : patch.vertices) {
      if (!is_finite(v)) return malformed("a vertex that is not finite");
    }
    share_points(patch);
    complete_patch(patch);
    return in_.status("paper: triangles");
  }

  void read_triangle(PlanarPatch& patch) {
    PatchTriangle t;
    for (std::uint32_t& v : t.vertices) {
      v = static_cast<std::uint32_t>(patch.vertices.size());
      patch.vertices.push_back(read_position());
    }
    if (info_ != nullptr) {
      for (std::uint16_t& c : t.rgb) c = info_->scalar == ScalarType::u8 ? in_.u8() : in_.u16();
    }
    patch.triangles.push_back(t);
  }

  /// Algorithm 2: At / A of the plane's points go to triangle t.
  static void share_points(PlanarPatch& patch) {
    std::vector<double> areas;
    double largest = 0;
    for (const PatchTriangle& t : patch.triangles) {
      const auto& v = patch.vertices;
      areas.push_back(triangle_area(v[t.vertices[0]], v[t.vertices[1]], v[t.vertices[2]]));
      largest = std::max(largest, areas.back());
    }
    std::vector<std::uint64_t> weights(areas.size());
    if (largest > 0 && std::isfinite(largest)) {
      for (std::size_t i = 0; i < areas.size(); ++i) {
        weights[i] = static_cast<std::uint64_t>(areas[i] / largest * 1099511627776.0);
      }
    }
    const std::vector<std::uint32_t> shares = apportion(weights, patch.points);
    for (std::size_t i = 0; i < shares.size(); ++i) patch.triangles[i].points = shares[i];
  }

  Status read_rest(Content& c, std::uint64_t left) {
    const std::uint32_t points = in_.u32();
    MAPCODEC_TRY(in_.status("paper: remaining points"));
    if (points != left) return malformed("points do not add up to the tile's count");
    if (points > in_.left() / (12 + color_bytes())) return truncated();
    c.rest.reserve(points);
    for (std::uint32_t i = 0; i < points; ++i) {
      Vec3 p = read_position();
      if (!is_finite(p)) return malformed("a point that is not finite");
      if (as_f32_) p = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
      c.rest.push_back(p);
      const ByteSpan color = in_.raw(color_bytes());
      c.rest_color.insert(c.rest_color.end(), color.begin(), color.end());
    }
    if (in_.left() != 0) return malformed("bytes after the end");
    return in_.status("paper: remaining points");
  }

  ByteReader in_;
  std::size_t channel_;
  const ChannelInfo* info_ = nullptr;
  bool as_f32_ = true;
  Vec3 corner_{};
};

}  // namespace

Result<Content> read_raw_content(ByteSpan bytes, std::uint64_t count, const MapSchema& schema) {
  return RawReader(bytes, schema).read(count);
}

}  // namespace mapcodec::paper
