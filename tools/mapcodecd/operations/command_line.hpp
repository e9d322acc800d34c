// SPDX-License-Identifier: GPL-3.0-or-later
// What mapcodecd understands: options that stand above its configuration file, and verbs for its catalogue.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "tools/mapcodecd/settings.hpp"

namespace mapcodec::daemon {

struct CommandLine {
  std::string config_file;
  std::optional<std::string> folder, port_file, log_level;
  std::optional<std::vector<std::string>> listen, http;
  bool insecure = false, log_json = false, print_config = false, check_config = false;
  /// Of the verb that was given, run instead of serving; @return exit code.
  std::function<int(const DaemonSettings&)> verb;
};

/// Parsing fills `line`, which must outlive the app.
void add_options(CLI::App& app, CommandLine& line);
/// token add, list, revoke; jobs; retention.
void add_token_verbs(CLI::App& app, CommandLine& line);
void add_catalogue_verbs(CLI::App& app, CommandLine& line);

/// The configuration with what the command line says over it. Errors: as read_config, the file's name before.
[[nodiscard]] Result<DaemonSettings> settings_of(const CommandLine& line);

/// "mapcodecd: WHAT" on stderr. @return the exit code for the error: 2 usage, 3 input, 4 cannot write.
int fail(const Error& error);

/// Prints every finding on stderr. @return 0 or 2.
int report_check(const DaemonSettings& settings);

}  // namespace mapcodec::daemon
