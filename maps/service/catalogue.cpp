// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/catalogue.hpp"

#include "maps/service/catalogue_state.hpp"

namespace mapcodec {
namespace {

constexpr std::int64_t kSchemaVersion = 1;
constexpr std::int64_t kApplicationId = 0x4d415043;  // "MAPC", so that no other program's file is taken

constexpr const char* kSchema = R"(
CREATE TABLE tokens(id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, hash BLOB NOT NULL UNIQUE,
                    created_s INTEGER NOT NULL, expires_s INTEGER NOT NULL);
CREATE TABLE grants(token INTEGER NOT NULL REFERENCES tokens(id) ON DELETE CASCADE, map TEXT NOT NULL,
                    permitted INTEGER NOT NULL, PRIMARY KEY(token, map)) WITHOUT ROWID;
CREATE INDEX grants_of_map ON grants(map);
CREATE TABLE maps(name TEXT PRIMARY KEY, created_s INTEGER NOT NULL, created_by TEXT NOT NULL,
                  keep_last INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE jobs(id INTEGER PRIMARY KEY AUTOINCREMENT, map TEXT NOT NULL, kind TEXT NOT NULL, state INTEGER NOT NULL,
                  begun_s INTEGER NOT NULL, ended_s INTEGER NOT NULL DEFAULT 0, outcome TEXT NOT NULL DEFAULT '');
CREATE INDEX running ON jobs(map, kind) WHERE state = 0;
PRAGMA user_version = 1;
PRAGMA application_id = 0x4d415043;
)";

Result<std::int64_t> number(Database& database, std::string_view query) {
  MAPCODEC_ASSIGN(Statement statement, database.prepare(query));
  MAPCODEC_ASSIGN(const bool row, statement.step());
  return row ? statement.integer(0) : 0;
}

/// Makes the tables in a new file; checks whose they are in another. Two processes may come here at once.
Status prepare_schema(Database& database) {
  Transaction transaction(database);
  MAPCODEC_TRY(transaction.begin());
  MAPCODEC_ASSIGN(const std::int64_t tables, number(database, "SELECT count(*) FROM sqlite_schema"));
  if (tables == 0) {
    MAPCODEC_TRY(database.execute(kSchema));
    return transaction.commit();
  }
  MAPCODEC_ASSIGN(const std::int64_t application, number(database, "PRAGMA application_id"));
  if (application != kApplicationId) {
    return make_error(ErrorCode::kMalformed, "catalogue: the database belongs to another program");
  }
  MAPCODEC_ASSIGN(const std::int64_t version, number(database, "PRAGMA user_version"));
  if (version > kSchemaVersion) {
    return make_error(ErrorCode::kUnsupported, "catalogue: written by a newer version");
  }
  return {};
}

Result<Database> open_database(const std::string& path) {
  MAPCODEC_ASSIGN(Database database, Database::open(path));
  MAPCODEC_TRY(prepare_schema(database));
  return database;
}

}  // namespace

Catalogue::Catalogue(std::unique_ptr<State> state) : state_(std::move(state)) {}
Catalogue::~Catalogue() = default;

Result<std::unique_ptr<Catalogue>> Catalogue::open(const std::string& path, const Retention& defaults) {
  auto opened = open_database(path);
  if (!opened.ok()) return make_error(opened.error().code, path + ": " + opened.error().message);
  Database database = std::move(opened).value();
  auto state = std::make_unique<State>(std::move(database), defaults);
  MAPCODEC_ASSIGN(Statement check,
                  state->database.prepare(
                      "SELECT t.name, t.expires_s, max(g.permitted) FROM tokens t "
                      "LEFT JOIN grants g ON g.token = t.id AND (g.map = ?1 OR g.map = '*' OR ?1 = '') "
                      "WHERE t.hash = ?2 GROUP BY t.id"));
  state->check.emplace(std::move(check));
  return std::unique_ptr<Catalogue>(new Catalogue(std::move(state)));
}

}  // namespace mapcodec
