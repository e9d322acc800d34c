// SPDX-License-Identifier: GPL-3.0-or-later
// SQLite behind Result and destructors; what the catalogue stands on.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "mapcodec/base/result.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace mapcodec {

/// One prepared query. Threads: those of its database.
class Statement {
 public:
  explicit Statement(sqlite3_stmt* handle) : handle_(handle, &close) {}

  /// Values for the question marks, in order; starts the query anew.
  template <class... Values>
  Statement& bind(const Values&... values) {
    reset();
    int place = 0;
    (put(++place, values), ...);
    return *this;
  }
  /// True: a row is there. Errors: CannotWrite (full, read-only, locked), Unreadable, Malformed.
  [[nodiscard]] Result<bool> step();
  /// Steps to the end, looking at no row.
  [[nodiscard]] Status run();

  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] bool is_null(int column) const;
  /// Ends the query, so that it holds no lock.
  void reset();

 private:
  static void close(sqlite3_stmt* handle);
  void put(int place, std::int64_t value);
  void put(int place, std::string_view text);
  void put(int place, std::span<const std::uint8_t> bytes);
  std::unique_ptr<sqlite3_stmt, void (*)(sqlite3_stmt*)> handle_;
};

/// One connection. Threads: one at a time.
class Database {
 public:
  /// Opens or makes the file (mode 0600) with a write-ahead log. Errors: CannotWrite, Unreadable, Malformed.
  [[nodiscard]] static Result<Database> open(const std::string& path);
  /// Runs statements that give no rows. Errors: as Statement::step.
  [[nodiscard]] Status execute(const char* sql);
  /// Errors: Malformed (the schema is another).
  [[nodiscard]] Result<Statement> prepare(std::string_view sql);
  [[nodiscard]] std::int64_t last_id() const;
  /// Rows that the last statement changed.
  [[nodiscard]] std::int64_t changes() const;

 private:
  explicit Database(sqlite3* handle) : handle_(handle, &close) {}
  static void close(sqlite3* handle);
  std::unique_ptr<sqlite3, void (*)(sqlite3*)> handle_;
};

/// Ends in a rollback unless it was committed.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) {}
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction();
  [[nodiscard]] Status begin();
  [[nodiscard]] Status commit();

 private:
  Database& database_;
  bool open_ = false;
};

}  // namespace mapcodec
