// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/error_names.hpp"

#include <array>

namespace mapcodec {
namespace {

// In the order of ErrorCode.
constexpr std::array<std::string_view, 19> kNames{
    "InvalidArgument", "NotFound",         "Unreadable",     "Empty",
    "Truncated",       "Malformed",        "Unsupported",    "LimitExceeded",
    "UnknownCodec",    "ChecksumMismatch", "ArchiveDamaged", "CannotWrite",
    "PromiseBroken",   "Cancelled",        "Unreachable",    "Busy",
    "Unauthenticated", "Denied",           "Exists"};
static_assert(kNames.size() == static_cast<std::size_t>(ErrorCode::kExists) + 1);

}  // namespace

std::string_view error_name(ErrorCode code) {
  const auto i = static_cast<std::size_t>(code);
  return i < kNames.size() ? kNames[i] : "Malformed";
}

std::optional<ErrorCode> error_of_name(std::string_view name) {
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (kNames[i] == name) return static_cast<ErrorCode>(i);
  }
  return std::nullopt;
}

}  // namespace mapcodec
