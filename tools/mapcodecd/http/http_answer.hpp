// SPDX-License-Identifier: GPL-3.0-or-later
// What the routes make, before it becomes HTTP.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "maps/service/access.hpp"

namespace mapcodec::daemon {

struct HttpQuestion {
  std::string method;
  std::string path;           ///< percent signs decoded
  std::string revision;       ///< of the query; empty: the newest
  std::string if_none_match;  ///< header; empty: none
  std::string range;          ///< header; empty: none
  Credentials who;
};

/// Bytes that live as long as somebody holds them.
struct SharedBytes {
  std::shared_ptr<const void> owner;
  std::string_view bytes;
};

struct HttpAnswer {
  int status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::vector<std::pair<std::string, std::string>> headers;
  std::vector<SharedBytes> body;  ///< one after the other
  std::string route = "other";    ///< for counting
  std::string principal;
  std::string error;  ///< what went wrong, for the log

  [[nodiscard]] std::uint64_t size() const;
};

[[nodiscard]] SharedBytes shared_text(std::string text);

/// One line of text. Never says more than the caller may know.
[[nodiscard]] HttpAnswer plain_answer(int status, const std::string& line);

/// 400 InvalidArgument, 401 Unauthenticated, 403 Denied, 404 NotFound, 429 Busy, 500 others.
[[nodiscard]] HttpAnswer error_answer(const Error& error);

/// Leaves `length` bytes from `offset` on.
void cut_to(std::vector<SharedBytes>& body, std::uint64_t offset, std::uint64_t length);

/// Adds the entity tag, and makes of the whole entity what the conditions of the question ask for.
void apply_conditions(const HttpQuestion& question, const std::string& etag, HttpAnswer& answer);

}  // namespace mapcodec::daemon
