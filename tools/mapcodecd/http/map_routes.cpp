// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/map_routes.hpp"

#include "tools/mapcodecd/http/conditional.hpp"
#include "tools/mapcodecd/http/tile_path.hpp"

namespace mapcodec::daemon {
namespace {

using Counter = ServiceMetrics::Counter;

struct MapPath {
  std::string map, what, key;
};

/// "/maps/MAP/index" or "/maps/MAP/tiles/KEY"; nothing else.
std::optional<MapPath> parse_path(const std::string& path) {
  constexpr std::string_view kRoot = "/maps/", kIndex = "/index", kTiles = "/tiles/";
  if (path.rfind(kRoot, 0) != 0) return std::nullopt;
  const std::size_t end = path.find('/', kRoot.size());
  if (end == path.npos) return std::nullopt;
  const std::string map = path.substr(kRoot.size(), end - kRoot.size()), rest = path.substr(end);
  if (rest == kIndex) return MapPath{map, "index", {}};
  if (rest.rfind(kTiles, 0) != 0) return std::nullopt;
  return MapPath{map, "tile", rest.substr(kTiles.size())};
}

SharedBytes shared_segment(const std::shared_ptr<const Bytes>& segment) {
  return {segment, {reinterpret_cast<const char*>(segment->data()), segment->size()}};
}

std::string lengths(const std::vector<SegmentRef>& segments) {
  std::string text;
  for (const SegmentRef& segment : segments)
    text += (text.empty() ? "" : ",") + std::to_string(segment.length);
  return text;
}

HttpAnswer not_found() {
  return error_answer(make_error(ErrorCode::kNotFound, "there is nothing here"));
}

}  // namespace

HttpAnswer MapRoutes::answer(const HttpQuestion& question) {
  if (question.method != "GET" && question.method != "HEAD") {
    HttpAnswer answer = plain_answer(405, "only GET and HEAD");
    answer.headers.emplace_back("Allow", "GET, HEAD");
    answer.headers.emplace_back("Connection", "close");
    return answer;
  }
  if (question.path == "/healthz") return health();
  if (question.path == "/metrics") return figures(question);
  return map_route(question);
}

HttpAnswer MapRoutes::health() const {
  HttpAnswer answer = serving_ ? plain_answer(200, "ok") : plain_answer(503, "not serving");
  answer.route = "healthz";
  return answer;
}

HttpAnswer MapRoutes::figures(const HttpQuestion& question) {
  const auto admission = access_.admit(question.who, Right::read, "", CallKind::unary);
  HttpAnswer answer;
  if (admission.ok()) {
    answer.principal = (*admission)->principal();
    answer.content_type = "text/plain; version=0.0.4; charset=utf-8";
    answer.body.push_back(shared_text(hooks_.metrics_text()));
  } else {
    answer = error_answer(admission.error());
  }
  answer.route = "metrics";
  return answer;
}

HttpAnswer MapRoutes::map_route(const HttpQuestion& question) {
  const auto path = parse_path(question.path);
  if (!path) return not_found();
  // Before anything is looked up: a name becomes part of a file's path.
  if (!is_map_name(path->map)) {
    return error_answer(make_error(ErrorCode::kInvalidArgument, "this is no name of a map"));
  }
  const auto admission = access_.admit(question.who, Right::read, path->map, CallKind::unary);
  if (!admission.ok()) return error_answer(admission.error());
  auto made = path->what == "index" ? index(question, path->map) : tile(question, path->map, path->key);
  if (made.ok()) {
    const Status charged = (*admission)->charge(made->size());
    if (!charged.ok()) made = charged.error();
  }
  HttpAnswer answer = made.ok() ? std::move(made).value() : error_answer(made.error());
  answer.route = path->what;
  answer.principal = (*admission)->principal();
  return answer;
}

Result<HttpAnswer> MapRoutes::index(const HttpQuestion& question, const std::string& map) {
  MAPCODEC_ASSIGN(const MapViewPtr view, service_.view(map, question.revision));
  const auto index = indexes_.index(*view);
  HttpAnswer answer;
  answer.content_type = "application/json";
  answer.body.push_back({index, index->text});
  apply_conditions(question, index->etag, answer);
  metrics_.add(Counter::bytes_out, static_cast<double>(answer.size()));
  return answer;
}

Result<HttpAnswer> MapRoutes::tile(const HttpQuestion& question, const std::string& map,
                                   const std::string& key) {
  const auto wanted = parse_tile_path(key);
  if (!wanted) {
    return make_error(ErrorCode::kInvalidArgument, "a tile is LEVEL_X_Y_Z or SUBMAP_LEVEL_X_Y_Z");
  }
  MAPCODEC_ASSIGN(const MapViewPtr view, service_.view(map, question.revision));
  const auto tile = view->archive->find(wanted->key, wanted->submap);
  if (!tile) return make_error(ErrorCode::kNotFound, "the map has no such tile");
  return tile_of(question, *view, *tile);
}

Result<HttpAnswer> MapRoutes::tile_of(const HttpQuestion& question, const MapView& view, std::size_t tile) {
  const TileRecord& record = view.archive->tiles()[tile];
  MAPCODEC_ASSIGN(const ContentHash hash, view.archive->hash(record));
  HttpAnswer answer;
  answer.content_type = "application/octet-stream";
  answer.headers.emplace_back("Mapcodec-Revision", std::to_string(view.archive->revision()));
  answer.headers.emplace_back("Mapcodec-Codec", std::to_string(record.codec));
  answer.headers.emplace_back("Mapcodec-Points", std::to_string(record.points));
  answer.headers.emplace_back("Mapcodec-Segments", lengths(record.segments));
  const std::string etag = '"' + hash.to_string() + '"';
  if (!matches_etag(question.if_none_match, etag)) {  // what the client has is not read
    MAPCODEC_ASSIGN(const auto segments, service_.segments(view, tile));
    for (const auto& segment : segments) answer.body.push_back(shared_segment(segment));
  }
  apply_conditions(question, etag, answer);
  metrics_.add(answer.status == 304 ? Counter::tiles_not_modified : Counter::tiles_out);
  metrics_.add(Counter::bytes_out, static_cast<double>(answer.size()));
  return answer;
}

}  // namespace mapcodec::daemon
