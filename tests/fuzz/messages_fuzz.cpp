// SPDX-License-Identifier: GPL-3.0-or-later
// Messages of the map service on any bytes: the first byte chooses which; what parses is checked as the
// handlers check it, and so are names, tokens and what HTTP brings.
#include "maps/service/tokens.hpp"
#include "maps/service/v1/map_service.pb.h"
#include "maps/service/wire.hpp"
#include "tools/mapcodecd/http/conditional.hpp"
#include "tools/mapcodecd/http/tile_path.hpp"

#include <cstdlib>

namespace {

using namespace mapcodec;
constexpr std::uint64_t kMostPoints = 1 << 16;

void check_points(const v1::Points& points) {
  const auto cloud = wire::read(points, kMostPoints);
  if (cloud.ok() && cloud->size() > kMostPoints) std::abort();
}

void check_scan(const v1::InsertRequest& request) {
  check_points(request.scan().points());
  (void)wire::read(request.scan().t_submap_scan()).ok();
  (void)wire::read(request.scan().t_map_submap()).ok();
}

void check_selection(const v1::GetTilesRequest& request) {
  for (const v1::TileKey& key : request.keys()) (void)wire::read(key).ok();
  (void)wire::read(request.box());
}

template <class Message, class Check>
void parse(const std::uint8_t* data, std::size_t size, Check check) {
  Message message;
  if (message.ParseFromArray(data, static_cast<int>(size))) check(message);
}

void check_text(std::string_view text) {
  (void)is_map_name(std::string(text));
  (void)bearer_token(text);
  (void)daemon::matches_etag(text, "\"0123\"");
  const auto range = daemon::parse_range(text, 1000);
  if (range.offset > 1000 || range.length > 1000 - range.offset) std::abort();
  if (const auto key = daemon::parse_tile_path(text); key && daemon::tile_path(*key) != text) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto silent = google::protobuf::SetLogHandler(nullptr);
  (void)silent;
  if (size < 1) return 0;
  const std::uint8_t kind = *data++;
  --size;
  switch (kind % 5) {
    case 0:
      parse<v1::InsertRequest>(data, size, check_scan);
      break;
    case 1:
      parse<v1::GetTilesRequest>(data, size, check_selection);
      break;
    case 2:
      parse<v1::Points>(data, size, check_points);
      break;
    case 3:
      parse<v1::MapFacts>(data, size, [](const v1::MapFacts& facts) { (void)wire::read(facts).ok(); });
      break;
    default:
      check_text({reinterpret_cast<const char*>(data), size});
  }
  return 0;
}
