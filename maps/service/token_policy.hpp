// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace mapcodec {

/// Who must show a token. A token that is shown counts in every case: a wrong one is refused, and a read
/// token does not write.
enum class TokenPolicy : std::uint8_t {
  required,  ///< everybody
  remote,    ///< everybody but those on this machine (unix socket, loopback)
};

}  // namespace mapcodec
