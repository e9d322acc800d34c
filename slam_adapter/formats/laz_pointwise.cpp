// SPDX-License-Identifier: GPL-3.0-or-later
#include <string_view>

#include "slam_adapter/formats/laz_items.hpp"
#include "slam_adapter/formats/laz_points.hpp"

namespace mapcodec {
namespace {

/// Decodes one item of every point after the first.
class Item {
 public:
  virtual ~Item() = default;
  virtual void next(LazDecoder& from, std::uint8_t* item) = 0;
};

/// Contexts of a return number (row: number of returns, column: return), also for files that count from 0.
constexpr std::string_view kReturnMap[8] = {"fedcba98", "e0136aa9", "d1247bba", "c3458ccb",
                                            "b6789ddc", "aabcdeed", "9abcdefe", "89abcdef"};
std::size_t return_map(std::size_t returns, std::size_t number) {
  const char c = kReturnMap[returns][number];
  return static_cast<std::size_t>(c <= '9' ? c - '0' : c - 'a' + 10);
}
std::size_t return_level(std::size_t returns, std::size_t number) {
  return returns > number ? returns - number : number - returns;
}

class Point10 final : public Item {
 public:
  explicit Point10(const std::uint8_t* first) {
    std::memcpy(last_.data(), first, last_.size());
    laz_store<std::uint16_t>(&last_[12], 0);
  }

  void next(LazDecoder& from, std::uint8_t* item) override {
    const std::uint32_t changed = from.symbol(changed_);
    if (changed & 32) last_[14] = static_cast<std::uint8_t>(from.symbol(flags_[last_[14]]));
    const std::size_t number = last_[14] & 7, returns = last_[14] >> 3 & 7;
    const std::size_t map = return_map(returns, number), level = return_level(returns, number);
    attributes(from, changed, map);
    position(from, map, level, returns == 1 ? 1 : 0);
    std::memcpy(item, last_.data(), last_.size());
  }

 private:
  void attributes(LazDecoder& from, std::uint32_t changed, std::size_t map) {
    if (changed & 16) {
      intensity_[map] =
          static_cast<std::uint16_t>(intensities_.next(from, intensity_[map], std::min<std::size_t>(map, 3)));
    }
    laz_store(&last_[12], intensity_[map]);
    if (changed & 8) last_[15] = static_cast<std::uint8_t>(from.symbol(classes_[last_[15]]));
    if (changed & 4) {
      LazSymbols& model = angles_[last_[14] >> 6 & 1];
      last_[16] = static_cast<std::uint8_t>(last_[16] + from.symbol(model));
    }
    if (changed & 2) last_[17] = static_cast<std::uint8_t>(from.symbol(user_[last_[17]]));
    if (changed & 1) {
      laz_store(&last_[18],
                static_cast<std::uint16_t>(sources_.next(from, laz_load<std::uint16_t>(&last_[18]))));
    }
  }

  void position(LazDecoder& from, std::size_t map, std::size_t level, std::size_t single) {
    const std::int32_t dx = dx_.next(from, x_[map].get(), single);
    x_[map].add(dx);
    const std::int32_t dy = dy_.next(from, y_[map].get(), single + even_bits(dx_.last_bits(), 20));
    y_[map].add(dy);
    const unsigned bits = (dx_.last_bits() + dy_.last_bits()) / 2;
    heights_[level] = z_.next(from, heights_[level], single + even_bits(bits, 18));
    laz_store(&last_[0], wrapped_sum(laz_load<std::int32_t>(&last_[0]), dx));
    laz_store(&last_[4], wrapped_sum(laz_load<std::int32_t>(&last_[4]), dy));
    laz_store(&last_[8], heights_[level]);
  }

  std::array<std::uint8_t, 20> last_{};
  std::array<LazMedian, 16> x_, y_;
  std::array<std::uint16_t, 16> intensity_{};
  std::array<std::int32_t, 8> heights_{};
  LazSymbols changed_{64};
  LazModels flags_{256, 256}, classes_{256, 256}, user_{256, 256};
  std::array<LazSymbols, 2> angles_;
  LazIntegers intensities_{16, 4}, sources_{16, 1}, dx_{32, 2}, dy_{32, 22}, z_{32, 20};
};

class GpsTime final : public Item {
 public:
  explicit GpsTime(const std::uint8_t* first) : time_(true, laz_load<std::uint64_t>(first)) {}
  void next(LazDecoder& from, std::uint8_t* item) override { laz_store(item, time_.next(from)); }

 private:
  LazTime time_;
};

class Rgb final : public Item {
 public:
  explicit Rgb(const std::uint8_t* first) : last_(laz_load<LazColor::Rgb>(first)) {}
  void next(LazDecoder& from, std::uint8_t* item) override {
    last_ = color_.next(from, last_);
    laz_store(item, last_);
  }

 private:
  LazColor::Rgb last_;
  LazColor color_;
};

class RawBytes final : public Item {
 public:
  RawBytes(const std::uint8_t* first, std::size_t size) : last_(first, first + size), models_(size, 256) {}
  void next(LazDecoder& from, std::uint8_t* item) override {
    for (std::size_t i = 0; i < last_.size(); ++i)
      item[i] = last_[i] = static_cast<std::uint8_t>(last_[i] + from.symbol(models_[i]));
  }

 private:
  Bytes last_;
  LazModels models_;
};

Result<std::unique_ptr<Item>> make_item(const LazItem& item, const std::uint8_t* first) {
  switch (item.type) {
    case LazItemType::point10:
      return std::unique_ptr<Item>(std::make_unique<Point10>(first));
    case LazItemType::gps_time:
      return std::unique_ptr<Item>(std::make_unique<GpsTime>(first));
    case LazItemType::rgb:
      return std::unique_ptr<Item>(std::make_unique<Rgb>(first));
    case LazItemType::bytes:
      return std::unique_ptr<Item>(std::make_unique<RawBytes>(first, item.size));
    default:
      return make_error(ErrorCode::kUnsupported, "is LAZ with a mixture of point coders");
  }
}

class PointwiseChunk final : public LazChunk {
 public:
  PointwiseChunk(Bytes first, std::vector<std::size_t> sizes, std::vector<std::unique_ptr<Item>> items,
                 const LazBytes& bytes)
      : first_(std::move(first)), sizes_(std::move(sizes)), items_(std::move(items)), bytes_(bytes) {}

  bool next(std::uint8_t* row) override {
    if (!began_) {
      std::memcpy(row, first_.data(), first_.size());
      began_ = true;
      return true;
    }
    if (!decoding_) {  // a chunk of one point has no coded bytes
      decoder_.begin(bytes_);
      decoding_ = true;
    }
    for (std::size_t i = 0; i < items_.size(); ++i) {
      items_[i]->next(decoder_, row);
      row += sizes_[i];
    }
    return !decoder_.failed();
  }

 private:
  Bytes first_;
  std::vector<std::size_t> sizes_;
  std::vector<std::unique_ptr<Item>> items_;
  LazBytes bytes_;
  LazDecoder decoder_;
  bool began_ = false, decoding_ = false;
};

}  // namespace

Result<std::unique_ptr<LazChunk>> open_pointwise_chunk(const std::vector<LazItem>& items,
                                                       const ByteStream& stream, std::uint64_t begin,
                                                       std::uint64_t end) {
  std::vector<std::size_t> sizes;
  std::size_t total = 0;
  for (const LazItem& i : items) sizes.push_back(i.size), total += i.size;
  LazBytes bytes(stream, begin, end);
  Bytes first(total);
  bytes.raw(first.data(), total);
  if (bytes.failed())
    return make_error(ErrorCode::kTruncated, "ends within the first point of a chunk", begin);
  std::vector<std::unique_ptr<Item>> coders;
  for (std::size_t i = 0, at = 0; i < items.size(); at += sizes[i++]) {
    MAPCODEC_ASSIGN(std::unique_ptr<Item> coder, make_item(items[i], first.data() + at));
    coders.push_back(std::move(coder));
  }
  return std::unique_ptr<LazChunk>(
      std::make_unique<PointwiseChunk>(std::move(first), std::move(sizes), std::move(coders), bytes));
}

}  // namespace mapcodec
