// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "maps/service/catalogue_state.hpp"
#include "maps/service/map_service.hpp"
#include "maps/service/token_secret.hpp"

namespace mapcodec {
namespace {

constexpr std::size_t kMaxTokenName = 64;

Status check_token_name(const std::string& name) {
  const bool printable = std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < 127; });
  if (!name.empty() && name.size() <= kMaxTokenName && printable) return {};
  return make_error(ErrorCode::kInvalidArgument,
                    "a token's name has 1 to 64 printable characters without spaces");
}

Status check_grants(const std::vector<MapGrant>& grants) {
  if (grants.empty())
    return make_error(ErrorCode::kInvalidArgument, "a token needs at least one map and right");
  for (const MapGrant& grant : grants) {
    if (grant.map != kEveryMap && !is_map_name(grant.map)) {
      return make_error(ErrorCode::kInvalidArgument, "a grant names a map or *");
    }
  }
  return {};
}

Status insert_grants(Database& database, std::int64_t token, const std::vector<MapGrant>& grants) {
  MAPCODEC_ASSIGN(
      Statement insert,
      database.prepare("INSERT INTO grants(token, map, permitted) VALUES(?, ?, ?) "
                       "ON CONFLICT DO UPDATE SET permitted = max(permitted, excluded.permitted)"));
  for (const MapGrant& grant : grants) {
    MAPCODEC_TRY(insert.bind(token, grant.map, static_cast<std::int64_t>(grant.right)).run());
  }
  return {};
}

}  // namespace

Result<std::string> Catalogue::add_token(const std::string& name, const std::vector<MapGrant>& grants,
                                         std::int64_t now_s, std::int64_t expires_s) {
  MAPCODEC_TRY(check_token_name(name));
  MAPCODEC_TRY(check_grants(grants));
  if (expires_s != 0 && expires_s <= now_s) {
    return make_error(ErrorCode::kInvalidArgument, "the token would have expired before its first use");
  }
  MAPCODEC_ASSIGN(std::string secret, make_token_secret());
  MAPCODEC_ASSIGN(const TokenHash hash, hash_token(secret));
  const std::lock_guard lock(state_->mutex);
  Transaction transaction(state_->database);
  MAPCODEC_TRY(transaction.begin());
  MAPCODEC_ASSIGN(
      Statement insert,
      state_->database.prepare("INSERT INTO tokens(name, hash, created_s, expires_s) VALUES(?, ?, ?, ?)"));
  if (const Status added = insert.bind(name, hash, now_s, expires_s).run(); !added.ok()) {
    if (added.error().code != ErrorCode::kInvalidArgument) return added.error();
    return make_error(ErrorCode::kExists, "there is a token of that name");
  }
  MAPCODEC_TRY(insert_grants(state_->database, state_->database.last_id(), grants));
  MAPCODEC_TRY(transaction.commit());
  return secret;
}

Result<std::vector<TokenInfo>> Catalogue::tokens() const {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(
      Statement query,
      state_->database.prepare("SELECT t.name, t.created_s, t.expires_s, g.map, g.permitted FROM tokens t "
                               "LEFT JOIN grants g ON g.token = t.id ORDER BY t.name, g.map"));
  std::vector<TokenInfo> tokens;
  for (;;) {
    MAPCODEC_ASSIGN(const bool row, query.step());
    if (!row) return tokens;
    if (tokens.empty() || tokens.back().name != query.text(0)) {
      tokens.push_back({query.text(0), {}, query.integer(1), query.integer(2)});
    }
    if (!query.is_null(3))
      tokens.back().grants.push_back({query.text(3), static_cast<Right>(query.integer(4))});
  }
}

Status Catalogue::revoke_token(const std::string& name) {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement erase, state_->database.prepare("DELETE FROM tokens WHERE name = ?"));
  MAPCODEC_TRY(erase.bind(name).run());
  if (state_->database.changes() == 0)
    return make_error(ErrorCode::kNotFound, "there is no token of that name");
  return {};
}

Result<TokenDecision> Catalogue::check(std::string_view secret, std::string_view map, Right right,
                                       std::int64_t now_s) const {
  if (secret.empty()) return TokenDecision{TokenState::missing, {}};
  MAPCODEC_ASSIGN(const TokenHash hash, hash_token(secret));
  const std::lock_guard lock(state_->mutex);
  Statement& query = *state_->check;
  MAPCODEC_ASSIGN(const bool known, query.bind(map, hash).step());
  TokenDecision decision{TokenState::unknown, {}};
  if (known) {
    const std::int64_t expires_s = query.integer(1);
    const bool expired = expires_s != 0 && now_s >= expires_s;
    const bool allowed = !query.is_null(2) && query.integer(2) >= static_cast<std::int64_t>(right);
    decision.token = query.text(0);
    decision.state = expired ? TokenState::expired : allowed ? TokenState::granted : TokenState::forbidden;
  }
  query.reset();
  return decision;
}

}  // namespace mapcodec
