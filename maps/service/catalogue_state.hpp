// SPDX-License-Identifier: GPL-3.0-or-later
// Inside of the catalogue, shared by its sources.
#pragma once

#include <ctime>
#include <mutex>

#include "maps/service/catalogue.hpp"
#include "maps/service/sqlite.hpp"

namespace mapcodec {

struct Catalogue::State {
  State(Database d, const Retention& r) : database(std::move(d)), defaults(r) {}
  std::mutex mutex;
  Database database;
  const Retention defaults;
  std::optional<Statement> check;  ///< prepared once: asked with every request
};

/// [s since epoch]
[[nodiscard]] inline std::int64_t now_s() {
  return static_cast<std::int64_t>(std::time(nullptr));
}

}  // namespace mapcodec
