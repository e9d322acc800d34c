// SPDX-License-Identifier: GPL-3.0-or-later
// How everything that the world can break reports it: a value or an Error, never an exception.
#pragma once

#include <cassert>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>

namespace mapcodec {

enum class ErrorCode : std::uint8_t {
  kInvalidArgument,   ///< a setting out of its range
  kNotFound,          ///< no such file, revision, tile
  kUnreadable,        ///< exists but cannot be read (permission, directory, device error)
  kEmpty,             ///< readable, but holds no point
  kTruncated,         ///< ends before its own counts say
  kMalformed,         ///< contradicts its format
  kUnsupported,       ///< a known format or version that this build does not read
  kLimitExceeded,     ///< would need more than DecodeLimits allow
  kUnknownCodec,      ///< a tile codec id that this build does not know
  kChecksumMismatch,  ///< stored and computed CRC differ
  kArchiveDamaged,    ///< the archive's structure is broken
  kCannotWrite,       ///< disk full, permission, failed fsync
  kPromiseBroken,     ///< what was decoded is not what was promised
  kCancelled,         ///< the caller asked to stop
  kUnreachable,       ///< server or store does not answer
  kBusy,              ///< a queue or a limit is full: the same again later may do
  kUnauthenticated,   ///< no token, or one that is not known or no longer good
  kDenied,            ///< known, but without this right
  kExists,            ///< the name is taken
};

/// What went wrong, in one sentence without a final stop, and where.
struct Error {
  ErrorCode code = ErrorCode::kMalformed;
  std::string message;
  std::optional<std::uint64_t> offset;  ///< byte offset in the file or payload, where known

  /// "message (at byte N)".
  [[nodiscard]] std::string to_string() const {
    return offset ? message + " (at byte " + std::to_string(*offset) + ")" : message;
  }
};

[[nodiscard]] inline Error make_error(ErrorCode code, std::string message,
                                      std::optional<std::uint64_t> offset = std::nullopt) {
  return Error{code, std::move(message), offset};
}

/// A value or an Error. Must be looked at; `value()` on an error is a programming mistake.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit by design
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}  // NOLINT: implicit by design

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  [[nodiscard]] T& value() & {
    assert(ok());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    assert(ok());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T&& value() && {
    assert(ok());
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] const Error& error() const {
    assert(!ok());
    return *std::get_if<1>(&state_);
  }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }

 private:
  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}  // NOLINT: implicit by design
  [[nodiscard]] bool ok() const { return !error_.has_value(); }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] const Error& error() const {
    assert(error_);
    return *error_;
  }

 private:
  std::optional<Error> error_;
};

using Status = Result<void>;

}  // namespace mapcodec

/// Returns the error of `expr` from the enclosing function, if it has one.
#define MAPCODEC_TRY(expr)                                        \
  do {                                                            \
    if (auto mapcodec_status_ = (expr); !mapcodec_status_.ok()) { \
      return mapcodec_status_.error();                            \
    }                                                             \
  } while (false)

#define MAPCODEC_CONCAT_INNER(a, b) a##b
#define MAPCODEC_CONCAT(a, b) MAPCODEC_CONCAT_INNER(a, b)

/// `MAPCODEC_ASSIGN(auto x, f());` binds x to the value of f() or returns its error.
#define MAPCODEC_ASSIGN(declaration, expr) \
  MAPCODEC_ASSIGN_INNER(declaration, expr, MAPCODEC_CONCAT(mapcodec_result_, __LINE__))
#define MAPCODEC_ASSIGN_INNER(declaration, expr, name) \
  auto name = (expr);                                  \
  if (!name.ok()) return name.error();                 \
  declaration = std::move(name).value()
