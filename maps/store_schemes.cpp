// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/store_schemes.hpp"

#include <vector>

#include "maps/file_store.hpp"

namespace mapcodec {
namespace {

struct Scheme {
  std::string prefix;
  StoreOpener opener;
};

std::vector<Scheme>& schemes() {
  static std::vector<Scheme> all;
  return all;
}

const Scheme* scheme_of(const std::string& place) {
  for (const Scheme& s : schemes()) {
    if (place.rfind(s.prefix, 0) == 0) return &s;
  }
  return nullptr;
}

}  // namespace

void register_store_scheme(const std::string& prefix, StoreOpener opener) {
  schemes().push_back({prefix, std::move(opener)});
}

bool has_store_scheme(const std::string& place) {
  return scheme_of(place) != nullptr;
}

Result<std::unique_ptr<TileStore>> open_store(const std::string& place) {
  if (const Scheme* s = scheme_of(place)) return s->opener(place);
  MAPCODEC_ASSIGN(std::unique_ptr<FileStore> file, FileStore::open_for_reading(place));
  return std::unique_ptr<TileStore>(std::move(file));
}

}  // namespace mapcodec
