// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <optional>
#include <string_view>

#include "slam_adapter/formats/laz_items.hpp"
#include "slam_adapter/formats/laz_points.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kChannels = 4;  ///< of a scanner; each has models of its own

/// The stream of one attribute.
struct Layer {
  LazDecoder decoder;
  bool present = false;  ///< otherwise the attribute is that of the first point
};

/// One item of the layered generation. `channel` is chosen by the point item, which comes first.
class Item {
 public:
  virtual ~Item() = default;
  virtual void next(std::uint8_t* item, std::size_t& channel) = 0;
  /// Whether a layer has run dry.
  [[nodiscard]] bool failed() const {
    return std::any_of(layers_.begin(), layers_.end(),
                       [](const Layer& l) { return l.present && l.decoder.failed(); });
  }

 protected:
  explicit Item(std::vector<Layer> layers) : layers_(std::move(layers)) {}
  std::vector<Layer> layers_;
};

/// Contexts of a return (row: number of returns, column: return number).
constexpr std::string_view kReturnMap[16] = {
    "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
    "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
    "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
    "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455"};

/// What point format 6 has in common with the formats after it, taken apart.
struct Point {
  std::int32_t x = 0, y = 0, z = 0;
  std::uint16_t intensity = 0, source = 0;
  std::uint8_t number = 0, returns = 0;
  std::uint8_t flags = 0;  ///< class flags, scan direction (bit 4), edge (bit 5)
  std::uint8_t classification = 0, user = 0;
  std::int16_t angle = 0;
  std::uint64_t time = 0;
  bool time_changed = false;
};

Point take_apart(const std::uint8_t* item) {
  Point p;
  p.x = laz_load<std::int32_t>(item);
  p.y = laz_load<std::int32_t>(item + 4);
  p.z = laz_load<std::int32_t>(item + 8);
  p.intensity = laz_load<std::uint16_t>(item + 12);
  p.number = item[14] & 15;
  p.returns = item[14] >> 4;
  p.flags = static_cast<std::uint8_t>((item[15] & 15) | (item[15] >> 6 & 3) << 4);
  p.classification = item[16];
  p.user = item[17];
  p.angle = laz_load<std::int16_t>(item + 18);
  p.source = laz_load<std::uint16_t>(item + 20);
  p.time = laz_load<std::uint64_t>(item + 22);
  return p;
}

void put_together(const Point& p, std::size_t channel, std::uint8_t* item) {
  laz_store(item, p.x);
  laz_store(item + 4, p.y);
  laz_store(item + 8, p.z);
  laz_store(item + 12, p.intensity);
  item[14] = static_cast<std::uint8_t>(p.number | p.returns << 4);
  item[15] = static_cast<std::uint8_t>((p.flags & 15) | channel << 4 | (p.flags >> 4 & 3) << 6);
  item[16] = p.classification;
  item[17] = p.user;
  laz_store(item + 18, p.angle);
  laz_store(item + 20, p.source);
  laz_store(item + 22, p.time);
}

/// First (1), last (2), both (3) or between (0).
unsigned place_of(unsigned number, unsigned returns) {
  return (number == 1 ? 1u : 0u) + (number >= returns ? 2u : 0u);
}

class Point14 final : public Item {
 public:
  enum : std::size_t { kXy, kZ, kClass, kFlags, kIntensity, kAngle, kUser, kSource, kTime, kLayers };

  Point14(std::vector<Layer> layers, const std::uint8_t* first, std::size_t& channel)
      : Item(std::move(layers)) {
    channel_ = channel = item_channel(first);
    contexts_[channel_].emplace(take_apart(first));
  }

  void next(std::uint8_t* item, std::size_t& channel) override {
    LazDecoder& xy = layers_[kXy].decoder;
    const Point& before = contexts_[channel_]->last;
    const std::size_t model = place_of(before.number, before.returns) + (before.time_changed ? 4u : 0u);
    const std::uint32_t changed = xy.symbol(contexts_[channel_]->changed[model]);
    if (changed & 64) change_channel(xy);
    channel = channel_;
    Context& c = *contexts_[channel_];
    const bool time_changed = (changed & 16) != 0;
    returns(xy, c, changed, time_changed);
    position(xy, c, time_changed);
    attributes(c, changed, time_changed);
    if (time_changed && layers_[kTime].present) c.last.time = c.time.next(layers_[kTime].decoder);
    put_together(c.last, channel_, item);
    c.last.time_changed = time_changed;
  }

 private:
  /// Everything learned of one channel of the scanner.
  struct Context {
    explicit Context(const Point& p) : last(p), time(false, p.time) {
      last.time_changed = false;
      heights.fill(p.z);
      intensity.fill(p.intensity);
    }
    Point last;
    std::array<LazMedian, 12> x, y;
    std::array<std::int32_t, 8> heights{};
    std::array<std::uint16_t, 8> intensity{};
    std::vector<LazSymbols> changed = std::vector<LazSymbols>(8, LazSymbols(128));
    LazSymbols channel{3}, number_same_time{13};
    LazModels returns{16, 16}, number{16, 16}, classes{64, 256}, flags{64, 64}, user{64, 256};
    LazIntegers dx{32, 2}, dy{32, 22}, z{32, 20}, intensities{16, 4}, angles{16, 2}, sources{16, 1};
    LazTime time;
  };

  static std::size_t item_channel(const std::uint8_t* item) { return item[15] >> 4 & 3; }

  void change_channel(LazDecoder& xy) {
    const Point& before = contexts_[channel_]->last;
    const std::size_t to = (channel_ + xy.symbol(contexts_[channel_]->channel) + 1) % kChannels;
    if (!contexts_[to]) contexts_[to].emplace(before);
    channel_ = to;
  }

  static void returns(LazDecoder& xy, Context& c, std::uint32_t changed, bool time_changed) {
    Point& p = c.last;
    const unsigned number = p.number;
    if (changed & 4) p.returns = static_cast<std::uint8_t>(xy.symbol(c.returns[p.returns]));
    unsigned now = number;
    switch (changed & 3) {
      case 1:
        now = number + 1;
        break;
      case 2:
        now = number + 15;
        break;
      case 3:
        now = time_changed ? xy.symbol(c.number[number]) : number + xy.symbol(c.number_same_time) + 2;
        break;
      default:
        break;
    }
    p.number = static_cast<std::uint8_t>(now % 16);
  }

  void position(LazDecoder& xy, Context& c, bool time_changed) {
    Point& p = c.last;
    const auto map = static_cast<std::size_t>(kReturnMap[p.returns][p.number] - '0');
    const std::size_t level = std::min(std::abs(int{p.returns} - int{p.number}), 7);
    const std::size_t single = p.returns == 1 ? 1 : 0, median = 2 * map + (time_changed ? 1 : 0);
    const std::int32_t dx = c.dx.next(xy, c.x[median].get(), single);
    c.x[median].add(dx);
    const std::int32_t dy = c.dy.next(xy, c.y[median].get(), single + even_bits(c.dx.last_bits(), 20));
    c.y[median].add(dy);
    p.x = wrapped_sum(p.x, dx);
    p.y = wrapped_sum(p.y, dy);
    if (!layers_[kZ].present) return;
    const unsigned bits = (c.dx.last_bits() + c.dy.last_bits()) / 2;
    p.z = c.z.next(layers_[kZ].decoder, c.heights[level], single + even_bits(bits, 18));
    c.heights[level] = p.z;
  }

  void attributes(Context& c, std::uint32_t changed, bool time_changed) {
    Point& p = c.last;
    const unsigned place = place_of(p.number, p.returns);
    if (Layer& l = layers_[kClass]; l.present) {
      const std::size_t model = (p.classification & 0x1fu) << 1 | (place == 3 ? 1u : 0u);
      p.classification = static_cast<std::uint8_t>(l.decoder.symbol(c.classes[model]));
    }
    if (Layer& l = layers_[kFlags]; l.present)
      p.flags = static_cast<std::uint8_t>(l.decoder.symbol(c.flags[p.flags]));
    if (Layer& l = layers_[kIntensity]; l.present) {
      std::uint16_t& last = c.intensity[place << 1 | (time_changed ? 1u : 0u)];
      last = static_cast<std::uint16_t>(c.intensities.next(l.decoder, last, place));
      p.intensity = last;
    }
    if (Layer& l = layers_[kAngle]; l.present && (changed & 8))
      p.angle = static_cast<std::int16_t>(c.angles.next(l.decoder, p.angle, time_changed ? 1 : 0));
    if (Layer& l = layers_[kUser]; l.present)
      p.user = static_cast<std::uint8_t>(l.decoder.symbol(c.user[p.user / 4]));
    if (Layer& l = layers_[kSource]; l.present && (changed & 32))
      p.source = static_cast<std::uint16_t>(c.sources.next(l.decoder, p.source));
  }

  std::array<std::optional<Context>, kChannels> contexts_;
  std::size_t channel_ = 0;
};

/// What items other than the point share: a context for each channel of the scanner, begun from the last
/// value of the channel before. Version 3 has a slip that its files keep: after a change to a channel that
/// was known already, one value is predicted from, and remembered in, the channel before.
template <class Context>
class ByChannel {
 public:
  ByChannel(std::size_t channel, Context first, bool slips) : at_(channel), slips_(slips) {
    contexts_[channel].emplace(std::move(first));
  }
  /// @param last  out: whose last value counts.
  Context& choose(std::size_t channel, Context*& last) {
    Context* before = &*contexts_[at_];
    if (channel != at_ && !contexts_[channel]) {
      contexts_[channel].emplace(before->fresh());
      before = &*contexts_[channel];
    }
    last = channel != at_ && !slips_ ? &*contexts_[channel] : before;
    at_ = channel;
    return *contexts_[channel];
  }

 private:
  std::array<std::optional<Context>, kChannels> contexts_;
  std::size_t at_;
  bool slips_;
};

class Rgb14 final : public Item {
 public:
  Rgb14(std::vector<Layer> layers, const std::uint8_t* first, std::size_t channel, bool slips)
      : Item(std::move(layers)), contexts_(channel, first_context(first, layers_.size() > 1), slips) {}

  void next(std::uint8_t* item, std::size_t& channel) override {
    Context* last = nullptr;
    Context& c = contexts_.choose(channel, last);
    if (layers_[0].present) last->rgb = c.color.next(layers_[0].decoder, last->rgb);
    laz_store(item, last->rgb);
    if (layers_.size() < 2) return;
    if (layers_[1].present) infrared(layers_[1].decoder, c, last->nir);
    laz_store(item + 6, last->nir);
  }

 private:
  struct Context {
    LazColor::Rgb rgb{};
    std::uint16_t nir = 0;
    LazColor color;
    LazSymbols nir_changed{4};
    std::array<LazSymbols, 2> nir_models;
    [[nodiscard]] Context fresh() const {
      Context r;
      r.rgb = rgb;
      r.nir = nir;
      return r;
    }
  };
  static Context first_context(const std::uint8_t* first, bool has_nir) {
    Context r;
    r.rgb = laz_load<LazColor::Rgb>(first);
    if (has_nir) r.nir = laz_load<std::uint16_t>(first + 6);
    return r;
  }
  static void infrared(LazDecoder& from, Context& c, std::uint16_t& value) {
    const std::uint32_t changed = from.symbol(c.nir_changed);
    std::uint32_t low = value & 0xffu, high = value >> 8;
    if (changed & 1) low = (low + from.symbol(c.nir_models[0])) & 0xff;
    if (changed & 2) high = (high + from.symbol(c.nir_models[1])) & 0xff;
    value = static_cast<std::uint16_t>(high << 8 | low);
  }

  ByChannel<Context> contexts_;
};

class Bytes14 final : public Item {
 public:
  Bytes14(std::vector<Layer> layers, const std::uint8_t* first, std::size_t channel, bool slips)
      : Item(std::move(layers)), contexts_(channel, Context(Bytes(first, first + layers_.size())), slips) {}

  void next(std::uint8_t* item, std::size_t& channel) override {
    Context* last = nullptr;
    Context& c = contexts_.choose(channel, last);
    for (std::size_t i = 0; i < layers_.size(); ++i) {
      if (layers_[i].present)
        last->values[i] = static_cast<std::uint8_t>(last->values[i] + layers_[i].decoder.symbol(c.models[i]));
      item[i] = last->values[i];
    }
  }

 private:
  struct Context {
    explicit Context(Bytes v) : values(std::move(v)), models(values.size(), 256) {}
    Bytes values;
    LazModels models;
    [[nodiscard]] Context fresh() const { return Context(values); }
  };
  ByChannel<Context> contexts_;
};

std::size_t layers_of(const LazItem& item) {
  switch (item.type) {
    case LazItemType::point14:
      return Point14::kLayers;
    case LazItemType::rgb14:
      return 1;
    case LazItemType::rgb_nir14:
      return 2;
    default:
      return item.size;
  }
}

class LayeredChunk final : public LazChunk {
 public:
  [[nodiscard]] Status open(const std::vector<LazItem>& items, const ByteStream& stream, std::uint64_t begin,
                            std::uint64_t end) {
    std::size_t total = 0, layers = 0;
    for (const LazItem& i : items) total += i.size, layers += layers_of(i);
    LazBytes bytes(stream, begin, end);
    first_.resize(total);
    bytes.raw(first_.data(), total);
    points_ = bytes.u32();
    std::vector<std::uint64_t> sizes(layers);
    for (std::uint64_t& s : sizes) s = bytes.u32();
    if (bytes.failed())
      return make_error(ErrorCode::kTruncated, "ends within the sizes of a chunk's layers", begin);
    std::uint64_t at = bytes.offset();
    std::size_t layer = 0, offset = 0, channel = 0;
    for (const LazItem& item : items) {
      std::vector<Layer> mine(layers_of(item));
      for (Layer& l : mine) {
        const std::uint64_t size = sizes[layer++];
        if (size > end - at)
          return make_error(ErrorCode::kTruncated, "has a layer that ends beyond its chunk", at);
        l.present = size > 0;
        if (l.present) l.decoder.begin(LazBytes(stream, at, at + size));
        at += size;
      }
      if (item.type == LazItemType::point14 && !mine[Point14::kXy].present && points_ > 1)
        return make_error(ErrorCode::kMalformed, "has a chunk of several points without coordinates", begin);
      add(item, std::move(mine), first_.data() + offset, channel);
      offset += item.size;
    }
    return {};
  }

  bool next(std::uint8_t* row) override {
    if (!began_) {
      std::memcpy(row, first_.data(), first_.size());
      began_ = true;
      return true;
    }
    std::size_t channel = 0;
    for (std::size_t i = 0; i < items_.size(); ++i) {
      items_[i]->next(row, channel);
      row += sizes_[i];
    }
    return std::none_of(items_.begin(), items_.end(), [](const auto& item) { return item->failed(); });
  }
  [[nodiscard]] std::uint64_t points() const override { return points_; }

 private:
  void add(const LazItem& item, std::vector<Layer> layers, const std::uint8_t* first, std::size_t& channel) {
    sizes_.push_back(item.size);
    const bool slips = item.version < 4;
    if (item.type == LazItemType::point14)
      items_.push_back(std::make_unique<Point14>(std::move(layers), first, channel));
    else if (item.type == LazItemType::bytes14)
      items_.push_back(std::make_unique<Bytes14>(std::move(layers), first, channel, slips));
    else
      items_.push_back(std::make_unique<Rgb14>(std::move(layers), first, channel, slips));
  }

  Bytes first_;
  std::vector<std::size_t> sizes_;
  std::vector<std::unique_ptr<Item>> items_;
  std::uint64_t points_ = 0;
  bool began_ = false;
};

}  // namespace

Result<std::unique_ptr<LazChunk>> open_layered_chunk(const std::vector<LazItem>& items,
                                                     const ByteStream& stream, std::uint64_t begin,
                                                     std::uint64_t end) {
  auto chunk = std::make_unique<LayeredChunk>();
  MAPCODEC_TRY(chunk->open(items, stream, begin, end));
  return std::unique_ptr<LazChunk>(std::move(chunk));
}

}  // namespace mapcodec
