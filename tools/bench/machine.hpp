// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace mapcodec::bench {

using Json = nlohmann::ordered_json;

/// CPU model, cores, compiler, version and commit of this build, and the number of threads used.
[[nodiscard]] Json machine_json(int threads);
/// The same in one sentence.
[[nodiscard]] std::string machine_text(int threads);
/// Cores that this process may use, at least 1.
[[nodiscard]] int usable_cores();

}  // namespace mapcodec::bench
