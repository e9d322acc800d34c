// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/sqlite.hpp"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

namespace mapcodec {
namespace {

constexpr int kBusyTimeoutMs = 5000;  // another process writes at most a few rows

ErrorCode code_of(int sqlite_code) {
  switch (sqlite_code & 0xff) {
    case SQLITE_FULL:
    case SQLITE_READONLY:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_PERM:
      return ErrorCode::kCannotWrite;
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
    case SQLITE_ERROR:
    case SQLITE_SCHEMA:
      return ErrorCode::kMalformed;
    case SQLITE_CONSTRAINT:
      return ErrorCode::kInvalidArgument;
    default:
      return ErrorCode::kUnreadable;
  }
}

Error error_of(sqlite3* handle, int sqlite_code) {
  const char* text = handle != nullptr ? sqlite3_errmsg(handle) : sqlite3_errstr(sqlite_code);
  return make_error(code_of(sqlite_code), std::string("catalogue: ") + text);
}

/// SQLite makes files as the umask says; hashes of tokens are for the owner only. Its log and shared memory
/// take the mode of the database.
Status make_private(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) return make_error(ErrorCode::kCannotWrite, "catalogue: cannot open for writing");
  ::close(fd);
  return {};
}

}  // namespace

void Statement::close(sqlite3_stmt* handle) {
  sqlite3_finalize(handle);
}
void Statement::reset() {
  sqlite3_reset(handle_.get());
}

Result<bool> Statement::step() {
  const int code = sqlite3_step(handle_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  const Error error = error_of(sqlite3_db_handle(handle_.get()), code);
  reset();
  return error;
}

Status Statement::run() {
  for (;;) {
    MAPCODEC_ASSIGN(const bool row, step());
    if (!row) break;
  }
  reset();
  return {};
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(handle_.get(), column);
}

std::string Statement::text(int column) const {
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(handle_.get(), column));
  if (bytes == nullptr) return {};
  return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(handle_.get(), column))};
}

bool Statement::is_null(int column) const {
  return sqlite3_column_type(handle_.get(), column) == SQLITE_NULL;
}

void Statement::put(int place, std::int64_t value) {
  sqlite3_bind_int64(handle_.get(), place, value);
}

void Statement::put(int place, std::string_view text) {
  sqlite3_bind_text64(handle_.get(), place, text.data(), text.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
}

void Statement::put(int place, std::span<const std::uint8_t> bytes) {
  sqlite3_bind_blob64(handle_.get(), place, bytes.data(), bytes.size(), SQLITE_TRANSIENT);
}

void Database::close(sqlite3* handle) {
  sqlite3_close_v2(handle);
}

Result<Database> Database::open(const std::string& path) {
  MAPCODEC_TRY(make_private(path));
  sqlite3* handle = nullptr;
  const int code =
      sqlite3_open_v2(path.c_str(), &handle, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, nullptr);
  Database database(handle);
  if (code != SQLITE_OK) return error_of(handle, code);
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, kBusyTimeoutMs);
  // FULL: a revoked token stays revoked after a power cut.
  MAPCODEC_TRY(
      database.execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;"
                       "PRAGMA trusted_schema = OFF;"));
  return database;
}

Status Database::execute(const char* sql) {
  const int code = sqlite3_exec(handle_.get(), sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return error_of(handle_.get(), code);
  return {};
}

Result<Statement> Database::prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(handle_.get(), sql.data(), static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (code != SQLITE_OK) return error_of(handle_.get(), code);
  return Statement(statement);
}

std::int64_t Database::last_id() const {
  return sqlite3_last_insert_rowid(handle_.get());
}
std::int64_t Database::changes() const {
  return sqlite3_changes64(handle_.get());
}

Transaction::~Transaction() {
  // What cannot be rolled back was never begun or is rolled back by SQLite itself.
  if (open_ && !database_.execute("ROLLBACK").ok()) open_ = false;
}

Status Transaction::begin() {
  MAPCODEC_TRY(database_.execute("BEGIN IMMEDIATE"));
  open_ = true;
  return {};
}

Status Transaction::commit() {
  MAPCODEC_TRY(database_.execute("COMMIT"));
  open_ = false;
  return {};
}

}  // namespace mapcodec
