// SPDX-License-Identifier: GPL-3.0-or-later
// Errors across a network: which one it was, beside the transport's own code.
#pragma once

#include <string_view>

#include "mapcodec/base/result.hpp"

namespace mapcodec {

/// Metadata that carries the name, and how long to wait.
inline constexpr const char* kErrorKey = "mapcodec-error";
inline constexpr const char* kRetryKey = "retry-after-ms";

/// "NotFound", "CannotWrite", ...
[[nodiscard]] std::string_view error_name(ErrorCode code);
/// Nothing for a name that this version does not know.
[[nodiscard]] std::optional<ErrorCode> error_of_name(std::string_view name);

}  // namespace mapcodec
