// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

using Rgb = std::array<std::uint8_t, 3>;

/// Pixels of 8-bit RGB, row after row from the top left.
struct Image {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;

  Image(int w, int h, Rgb fill = {255, 255, 255})
      : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), fill) {}
  [[nodiscard]] Rgb& at(int x, int y) { return pixels[index(x, y)]; }
  [[nodiscard]] const Rgb& at(int x, int y) const { return pixels[index(x, y)]; }
  [[nodiscard]] bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }

 private:
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

/// Writes `image` as PNG. Errors: CannotWrite.
[[nodiscard]] Status write_png(const Image& image, const std::string& path);

/// Writes `text` (letters, digits, common signs; small letters become capitals) with its top left corner at
/// x, y, in a 5 x 7 font of `scale` pixels a dot. What lies outside the image is left out.
void draw_text(Image& image, int x, int y, const std::string& text, int scale, Rgb color);
/// Width of that text [pixels].
[[nodiscard]] int text_width(const std::string& text, int scale);

}  // namespace mapcodec
