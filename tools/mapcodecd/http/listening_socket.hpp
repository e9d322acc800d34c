// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "maps/file_store.hpp"
#include "tools/mapcodecd/config/listen_address.hpp"

namespace mapcodec::daemon {

/// A socket that takes connections, without blocking.
struct ListeningSocket {
  FileHandle handle;
  ListenAddress address;  ///< as bound: with its port
};

/// A unix socket gets mode 0600; one that nobody serves any more is replaced.
/// Errors: CannotWrite (address in use, permission, no such folder).
[[nodiscard]] Result<ListeningSocket> listen_on(const ListenAddress& address);

}  // namespace mapcodec::daemon
