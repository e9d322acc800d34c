// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/catalogue_state.hpp"
#include "maps/service/map_service.hpp"

namespace mapcodec {
namespace {

constexpr std::uint64_t kMostRevisions = std::uint64_t{1} << 40;

Status check_map(const std::string& map, const Retention& retention) {
  if (!is_map_name(map)) return make_error(ErrorCode::kInvalidArgument, "not a name for a map");
  if (retention.keep_last >= 1 && retention.keep_last <= kMostRevisions) return {};
  return make_error(ErrorCode::kInvalidArgument, "at least one revision is kept");
}

}  // namespace

Status Catalogue::created(const std::string& map, const Retention& retention, const std::string& principal) {
  MAPCODEC_TRY(check_map(map, retention));
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement put, state_->database.prepare("INSERT OR REPLACE INTO maps VALUES(?, ?, ?, ?)"));
  return put.bind(map, now_s(), principal, static_cast<std::int64_t>(retention.keep_last)).run();
}

Status Catalogue::set_retention(const std::string& map, const Retention& retention) {
  MAPCODEC_TRY(check_map(map, retention));
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement put,
                  state_->database.prepare("INSERT INTO maps VALUES(?, ?, '', ?) ON CONFLICT(name) "
                                           "DO UPDATE SET keep_last = excluded.keep_last"));
  return put.bind(map, now_s(), static_cast<std::int64_t>(retention.keep_last)).run();
}

Status Catalogue::removed(const std::string& map) {
  const std::lock_guard lock(state_->mutex);
  Transaction transaction(state_->database);
  MAPCODEC_TRY(transaction.begin());
  for (const char* sql : {"DELETE FROM maps WHERE name = ?", "DELETE FROM grants WHERE map = ?",
                          "DELETE FROM jobs WHERE map = ?"}) {
    MAPCODEC_ASSIGN(Statement erase, state_->database.prepare(sql));
    MAPCODEC_TRY(erase.bind(map).run());
  }
  return transaction.commit();
}

Result<Retention> Catalogue::retention(const std::string& map) {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement query, state_->database.prepare("SELECT keep_last FROM maps WHERE name = ?"));
  MAPCODEC_ASSIGN(const bool known, query.bind(map).step());
  return known ? Retention{static_cast<std::uint64_t>(query.integer(0))} : state_->defaults;
}

Result<std::vector<CatalogueMap>> Catalogue::maps() const {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(
      Statement query,
      state_->database.prepare("SELECT name, created_s, created_by, keep_last FROM maps ORDER BY name"));
  std::vector<CatalogueMap> maps;
  for (;;) {
    MAPCODEC_ASSIGN(const bool row, query.step());
    if (!row) return maps;
    maps.push_back(
        {query.text(0), query.integer(1), query.text(2), {static_cast<std::uint64_t>(query.integer(3))}});
  }
}

}  // namespace mapcodec
