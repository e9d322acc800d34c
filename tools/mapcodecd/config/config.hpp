// SPDX-License-Identifier: GPL-3.0-or-later
// The configuration file of mapcodecd: TOML, every key optional, unknown keys refused.
#pragma once

#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

/// Reads a file over the defaults. Errors: NotFound, Unreadable; Malformed (not TOML), InvalidArgument
/// (unknown key, wrong type, out of range), both with line and column in the message.
[[nodiscard]] Result<DaemonSettings> read_config(const std::string& path);
/// The same from text.
[[nodiscard]] Result<DaemonSettings> parse_config(const std::string& text);

/// All settings as such a file, each with what it means. Reading it gives the same settings.
[[nodiscard]] std::string print_config(const DaemonSettings& settings);

/// What can be said without starting: addresses and how open they are, certificates with their keys, folders.
/// @return one sentence for each thing that is wrong; empty: nothing.
[[nodiscard]] std::vector<std::string> check_config(const DaemonSettings& settings);

/// Path of the catalogue: as set, or catalogue.db in the folder of the maps.
[[nodiscard]] std::string catalogue_path(const DaemonSettings& settings);

}  // namespace mapcodec::daemon
