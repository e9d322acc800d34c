// SPDX-License-Identifier: GPL-3.0-or-later
// One function per verb adds its subcommand; parsing picks the one to run.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace mapcodec::cli {

/// Set by the chosen verb while the command line is parsed; main runs it. @return exit code.
using Action = std::function<int()>;

void add_compress(CLI::App& app, Action& action);
void add_decompress(CLI::App& app, Action& action);
void add_info(CLI::App& app, Action& action);
void add_verify(CLI::App& app, Action& action);
void add_evaluate(CLI::App& app, Action& action);
void add_render(CLI::App& app, Action& action);
void add_bench(CLI::App& app, Action& action);
void add_log(CLI::App& app, Action& action);
void add_snapshot(CLI::App& app, Action& action);
void add_diff(CLI::App& app, Action& action);
void add_rollback(CLI::App& app, Action& action);
void add_compact(CLI::App& app, Action& action);
void add_repair(CLI::App& app, Action& action);
void add_update(CLI::App& app, Action& action);
void add_remove(CLI::App& app, Action& action);
void add_crop(CLI::App& app, Action& action);
void add_pose(CLI::App& app, Action& action);
void add_flatten(CLI::App& app, Action& action);
void add_merge(CLI::App& app, Action& action);
void add_rawlog(CLI::App& app, Action& action);
void add_sync(CLI::App& app, Action& action);  // where the client of services is built

}  // namespace mapcodec::cli
