// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "mapcodec/cloud/tile_key.hpp"
#include "mapcodec/quality/color_difference.hpp"
#include "tools/png_image.hpp"
#include "tools/render_camera.hpp"

namespace mapcodec {
namespace {

constexpr int kSupersampling = 2;  // pixels are means of 2 x 2, which smooths edges
constexpr Rgb kBackground{44, 48, 57}, kInk{226, 230, 236};

/// Colour by height on a scale of even lightness, dark blue over green to yellow.
class HeightRamp {
 public:
  explicit HeightRamp(const std::vector<Vec3>& points) {
    std::vector<double> z;
    for (const Vec3& p : points) z.push_back(p[2]);
    low_ = quantile(z, 0.02);
    high_ = std::max(quantile(z, 0.98), low_ + 1e-9);
  }
  [[nodiscard]] Rgb at(double z) const {
    static constexpr Rgb kStops[] = {{62, 30, 100}, {56, 72, 148},  {38, 116, 155}, {30, 152, 138},
                                     {82, 184, 98}, {170, 208, 52}, {248, 224, 48}};
    constexpr int kLast = static_cast<int>(std::size(kStops)) - 1;
    const double t = std::clamp((z - low_) / (high_ - low_), 0.0, 1.0) * kLast;
    const int i = std::min(static_cast<int>(t), kLast - 1);
    Rgb c{};
    for (std::size_t k = 0; k < 3; ++k) {
      c[k] =
          static_cast<std::uint8_t>(std::lround(kStops[i][k] + (t - i) * (kStops[i + 1][k] - kStops[i][k])));
    }
    return c;
  }

 private:
  double low_ = 0, high_ = 1;
};

/// Distance between neighbours on the surface around each point, from the number of points in its voxel or
/// the fullest of the voxels beside it (a surface often cuts but the corner of a voxel).
class Spacing {
 public:
  explicit Spacing(const PointCloud& cloud, const Box& box) {
    side_ = std::max(diagonal(box) / 250, 1e-6);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      // Decoded clouds hold points of one position side by side: they cover no more than one.
      const bool repeats = i > 0 && cloud.xyz[i] == cloud.xyz[i - 1];
      if (is_finite(cloud.xyz[i])) cells_[cell(cloud.xyz[i])].count += repeats ? 0 : 1;
    }
    for (auto& [key, c] : cells_) c.spacing = side_ / std::sqrt(static_cast<double>(fullest_around(key)));
  }
  [[nodiscard]] double at(const Vec3& p) const { return cells_.find(cell(p))->second.spacing; }

 private:
  struct Cell {
    std::uint32_t count = 0;
    double spacing = 0;
  };
  [[nodiscard]] TileKey cell(const Vec3& p) const {
    const auto index = [&](double v) {
      return static_cast<std::int32_t>(std::clamp(std::floor(v / side_), -2e9, 2e9));
    };
    return {index(p[0]), index(p[1]), index(p[2])};
  }
  [[nodiscard]] std::uint32_t fullest_around(const TileKey& k) const {
    std::uint32_t most = 0;
    for (int i = 0; i < 27; ++i) {
      const auto it = cells_.find({k.x + i % 3 - 1, k.y + i / 3 % 3 - 1, k.z + i / 9 - 1});
      if (it != cells_.end()) most = std::max(most, it->second.count);
    }
    return std::max(most, 1u);
  }
  double side_ = 1;
  std::unordered_map<TileKey, Cell, TileKeyHash> cells_;
};

/// One panel while it is drawn: the nearest splat's colour and depth in each fine pixel.
struct Panel {
  Image image;
  std::vector<float> depth;

  Panel(int width, int height) : image(width, height, kBackground), depth(image.pixels.size(), kNothing) {}
  static constexpr float kNothing = std::numeric_limits<float>::infinity();

  [[nodiscard]] float& depth_at(int x, int y) {
    return depth[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                 static_cast<std::size_t>(x)];
  }
  void splat(const Camera::Pixel& centre, double radius, Rgb color);
};

void Panel::splat(const Camera::Pixel& c, double radius, Rgb color) {
  const int x0 = std::max(0, static_cast<int>(c.x - radius)),
            y0 = std::max(0, static_cast<int>(c.y - radius));
  const int x1 = std::min(image.width - 1, static_cast<int>(c.x + radius));
  const int y1 = std::min(image.height - 1, static_cast<int>(c.y + radius));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double dx = x + 0.5 - c.x, dy = y + 0.5 - c.y, r2 = (dx * dx + dy * dy) / (radius * radius);
      // Farther from its middle a splat steps back, so that neighbours meet halfway; the smallest are whole
      // pixels.
      if (r2 > 1 && radius > 1) continue;
      const auto z = static_cast<float>(c.depth * (1 + 1e-3 * r2));
      if (z >= depth_at(x, y)) continue;
      depth_at(x, y) = z;
      image.at(x, y) = color;
    }
  }
}

void draw_points(const PointCloud& cloud, const Camera& camera, const HeightRamp& ramp, Panel& panel) {
  const std::vector<Vec3> some = sample(cloud);
  if (some.empty()) return;
  const Spacing spacing(cloud, inner_box(some));
  const std::optional<Colors> colors = Colors::of(cloud);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!is_finite(cloud.xyz[i])) continue;
    const Camera::Pixel c = camera.project(cloud.xyz[i]);
    const bool near = c.depth > 0 && std::abs(c.x) < 1e6 && std::abs(c.y) < 1e6;
    if (!near) continue;
    const double radius = std::clamp(1.35 * spacing.at(cloud.xyz[i]) * camera.focal() / c.depth, 0.75, 7.0);
    Rgb color = ramp.at(cloud.xyz[i][2]);
    if (colors) {
      const Vec3 rgb = colors->at(i);
      for (std::size_t k = 0; k < 3; ++k) color[k] = static_cast<std::uint8_t>(std::lround(rgb[k]));
    }
    panel.splat(c, radius, color);
  }
}

/// How much nearer the surroundings are: edges and creases darken (eye-dome lighting, Boucheny 2009).
float hollow(Panel& panel, int x, int y) {
  static constexpr int kAround[][2] = {{-2, 0}, {2, 0}, {0, -2}, {0, 2}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
  constexpr float kNoise = 0.008F;  // half a percent: what a depth camera's steps look like
  const float here = std::log2(panel.depth_at(x, y));
  float sum = 0;
  for (const auto& step : kAround) {
    const int nx = x + 2 * step[0], ny = y + 2 * step[1];
    if (!panel.image.contains(nx, ny) || panel.depth_at(nx, ny) == Panel::kNothing) continue;
    sum += std::max(0.0F, here - std::log2(panel.depth_at(nx, ny)) - kNoise);
  }
  return sum / 8;
}

void shade(Panel& panel) {
  const Image flat = panel.image;
  for (int y = 0; y < flat.height; ++y) {
    for (int x = 0; x < flat.width; ++x) {
      if (panel.depth_at(x, y) == Panel::kNothing) continue;
      const float light = std::max(0.35F, std::exp(-24.0F * hollow(panel, x, y)));
      for (std::size_t k = 0; k < 3; ++k) {
        panel.image.at(x, y)[k] = static_cast<std::uint8_t>(light * static_cast<float>(flat.at(x, y)[k]));
      }
    }
  }
}

Rgb mean_of_fine_pixels(const Image& fine, int x, int y) {
  int sum[3] = {0, 0, 0};
  for (int dy = 0; dy < kSupersampling; ++dy) {
    for (int dx = 0; dx < kSupersampling; ++dx) {
      const Rgb& c = fine.at(x * kSupersampling + dx, y * kSupersampling + dy);
      for (int k = 0; k < 3; ++k) sum[k] += c[static_cast<std::size_t>(k)];
    }
  }
  constexpr int kCount = kSupersampling * kSupersampling;
  return {static_cast<std::uint8_t>(sum[0] / kCount), static_cast<std::uint8_t>(sum[1] / kCount),
          static_cast<std::uint8_t>(sum[2] / kCount)};
}

/// Where a panel lies in the picture [pixels].
struct Place {
  int x, y, width, height;
};

void draw_panel(const PointCloud& cloud, const Camera& camera, const HeightRamp& ramp, const Place& place,
                Image& to) {
  Panel panel(place.width * kSupersampling, place.height * kSupersampling);
  draw_points(cloud, camera, ramp, panel);
  shade(panel);
  for (int y = 0; y < place.height; ++y) {
    for (int x = 0; x < place.width; ++x)
      to.at(place.x + x, place.y + y) = mean_of_fine_pixels(panel.image, x, y);
  }
}

void draw_caption(Image& image, const Place& place, const std::string& caption) {
  constexpr int kScale = 3;
  draw_text(image, place.x + (place.width - text_width(caption, kScale)) / 2, 14, caption, kScale, kInk);
}

}  // namespace

Status render_side_by_side(const PointCloud& left, const PointCloud& right, const RenderSettings& settings,
                           const std::string& path) {
  constexpr int kCaptionHeight = 48, kGap = 4;
  if (settings.width < 64 || settings.height < 96 || settings.width > 16384 || settings.height > 16384) {
    return make_error(ErrorCode::kInvalidArgument, "a picture is 64 x 96 to 16384 x 16384 pixels");
  }
  const std::vector<Vec3> some = sample(left);
  if (some.empty()) return make_error(ErrorCode::kEmpty, "nothing to draw: the cloud has no finite point");

  const int panels = right.empty() ? 1 : 2;
  Place place{0, kCaptionHeight, (settings.width - kGap * (panels - 1)) / panels,
              settings.height - kCaptionHeight};
  const Camera camera =
      fit_camera(some, settings, place.width * kSupersampling, place.height * kSupersampling);
  const HeightRamp ramp(some);
  Image image(settings.width, settings.height, kBackground);
  draw_panel(left, camera, ramp, place, image);
  draw_caption(image, place, settings.left_caption);
  if (panels == 2) {
    place.x = place.width + kGap;
    draw_panel(right, camera, ramp, place, image);
    draw_caption(image, place, settings.right_caption);
  }
  return write_png(image, path);
}

}  // namespace mapcodec
