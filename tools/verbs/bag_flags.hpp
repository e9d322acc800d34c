// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <CLI/CLI.hpp>

#include "slam_adapter/formats/bag_options.hpp"

namespace mapcodec::cli {

/// --topic, --poses and --frame, for every verb that reads ROS bags. `options` must outlive the parsing.
void add_bag_flags(CLI::App& verb, BagOptions& options);

}  // namespace mapcodec::cli
