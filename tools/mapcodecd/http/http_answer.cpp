// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/http/http_answer.hpp"

#include <algorithm>

#include "tools/mapcodecd/http/conditional.hpp"

namespace mapcodec::daemon {
namespace {

int status_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return 400;
    case ErrorCode::kUnauthenticated:
      return 401;
    case ErrorCode::kDenied:
      return 403;
    case ErrorCode::kNotFound:
      return 404;
    case ErrorCode::kBusy:
      return 429;
    default:
      return 500;
  }
}

}  // namespace

std::uint64_t HttpAnswer::size() const {
  std::uint64_t size = 0;
  for (const SharedBytes& part : body) size += part.bytes.size();
  return size;
}

SharedBytes shared_text(std::string text) {
  auto owner = std::make_shared<const std::string>(std::move(text));
  return {owner, *owner};
}

HttpAnswer plain_answer(int status, const std::string& line) {
  HttpAnswer answer;
  answer.status = status;
  answer.body.push_back(shared_text(line + "\n"));
  answer.headers.emplace_back("Cache-Control", "no-store");
  return answer;
}

HttpAnswer error_answer(const Error& error) {
  HttpAnswer answer = plain_answer(status_of(error.code), error.to_string());
  answer.error = error.to_string();
  if (answer.status == 401) answer.headers.emplace_back("WWW-Authenticate", "Bearer realm=\"mapcodecd\"");
  if (answer.status == 429) answer.headers.emplace_back("Retry-After", "1");
  return answer;
}

void cut_to(std::vector<SharedBytes>& body, std::uint64_t offset, std::uint64_t length) {
  std::vector<SharedBytes> kept;
  for (SharedBytes& part : body) {
    const std::uint64_t skipped = std::min<std::uint64_t>(offset, part.bytes.size());
    offset -= skipped;
    part.bytes = part.bytes.substr(skipped, length);
    length -= part.bytes.size();
    if (!part.bytes.empty()) kept.push_back(std::move(part));
  }
  body = std::move(kept);
}

void apply_conditions(const HttpQuestion& question, const std::string& etag, HttpAnswer& answer) {
  answer.headers.emplace_back("ETag", etag);
  answer.headers.emplace_back("Cache-Control", "private, no-cache");  // keep it, but ask each time
  answer.headers.emplace_back("Accept-Ranges", "bytes");
  if (matches_etag(question.if_none_match, etag)) {
    answer.status = 304;
    answer.body.clear();
    return;
  }
  const std::uint64_t size = answer.size();
  const ByteRange range = parse_range(question.range, size);
  if (range.kind == ByteRange::Kind::whole) return;
  const bool good = range.kind == ByteRange::Kind::part;
  answer.status = good ? 206 : 416;
  const std::string span =
      good ? std::to_string(range.offset) + "-" + std::to_string(range.offset + range.length - 1) : "*";
  answer.headers.emplace_back("Content-Range", "bytes " + span + "/" + std::to_string(size));
  cut_to(answer.body, range.offset, range.length);
}

}  // namespace mapcodec::daemon
