// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/codec/paper_decoder.hpp"

#include <cstring>

#include "mapcodec/codec/paper_content.hpp"
#include "mapcodec/codec/paper_sections.hpp"
#include "mapcodec/geometry/triangle_sampler.hpp"

namespace mapcodec {
namespace {

/// Writes one triangle's colour over its points.
void paint(const std::array<std::uint16_t, 3>& rgb, std::size_t begin, std::size_t count, Channel& color) {
  std::array<std::uint8_t, 6> value{};
  const bool narrow = color.info.scalar == ScalarType::u8;
  for (std::size_t c = 0; c < 3; ++c) {
    if (narrow) {
      value[c] = static_cast<std::uint8_t>(rgb[c]);
    } else {
      std::memcpy(&value[2 * c], &rgb[c], 2);
    }
  }
  const std::size_t stride = color.info.stride();
  std::uint8_t* to = color.at(begin);
  for (std::size_t i = 0; i < count; ++i, to += stride) std::memcpy(to, value.data(), stride);
}

void draw(const std::vector<PlanarPatch>& patches, std::size_t at, bool as_f32, Channel* color,
          PointCloud& cloud) {
  for (std::size_t p = 0; p < patches.size(); ++p) {
    SplitMix random(p);
    const std::vector<Vec3>& v = patches[p].vertices;
    for (const PatchTriangle& t : patches[p].triangles) {
      const std::span<Vec3> out(cloud.xyz.data() + at, t.points);
      sample_triangle(v[t.vertices[0]], v[t.vertices[1]], v[t.vertices[2]], random, as_f32, out);
      if (color != nullptr && t.points > 0) paint(t.rgb, at, t.points, *color);
      at += t.points;
    }
  }
}

void fill_constants(const MapSchema& schema, PointCloud& cloud) {
  for (const ChannelSchema& c : schema.channels) {
    Channel* channel = c.kept == ChannelKept::constant ? cloud.find(c.info.name) : nullptr;
    if (channel == nullptr || c.constant.size() != c.info.stride()) continue;
    for (std::size_t i = 0; i < cloud.size(); ++i)
      std::memcpy(channel->at(i), c.constant.data(), c.constant.size());
  }
}

Status check_memory(const PointCloud& layout, std::uint64_t count, const DecodeLimits& limits) {
  std::uint64_t stride = sizeof(Vec3);
  for (const Channel& c : layout.channels) stride += c.info.stride();
  if (count <= limits.max_bytes / stride) return {};
  return make_error(ErrorCode::kLimitExceeded,
                    "paper: " + std::to_string(count) + " points would need too much memory");
}

}  // namespace

Result<PointCloud> decode_paper(ByteSpan bytes, std::uint64_t count, const MapSchema& schema,
                                const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(paper::Content content, paper::read_content(bytes, count, schema, limits, true));
  PointCloud cloud = schema.layout();
  MAPCODEC_TRY(check_memory(cloud, count, limits));
  const std::size_t rest = content.rest.size();
  cloud.xyz = std::move(content.rest);
  cloud.resize(count);
  Channel* color = paper::color_channel(schema) != paper::kNoColor ? cloud.find("rgb") : nullptr;
  if (color != nullptr && !content.rest_color.empty()) {
    if (content.rest_color.size() != rest * color->info.stride()) {
      return make_error(ErrorCode::kMalformed, "paper: colours are not as many as points");
    }
    std::memcpy(color->data.data(), content.rest_color.data(), content.rest_color.size());
  }
  draw(content.patches, rest, schema.coordinates.kind == CoordinateFormat::Kind::f32, color, cloud);
  fill_constants(schema, cloud);
  return cloud;
}

Result<std::vector<PlanarPatch>> read_paper_patches(ByteSpan bytes, std::uint64_t count,
                                                    const MapSchema& schema, const DecodeLimits& limits) {
  MAPCODEC_ASSIGN(paper::Content content, paper::read_content(bytes, count, schema, limits, false));
  return std::move(content.patches);
}

}  // namespace mapcodec
