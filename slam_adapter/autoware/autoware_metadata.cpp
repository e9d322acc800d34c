// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/autoware/autoware_metadata.hpp"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdio>

namespace mapcodec {
namespace {

Error malformed(const std::string& what) {
  return make_error(ErrorCode::kMalformed, what);
}

Status read_tile(const std::string& name, const YAML::Node& value, AutowareMetadata& metadata) {
  if (name.empty() || name.find('/') != std::string::npos)
    return malformed("names the tile '" + name + "', which is no name of a file");
  if (!value.IsSequence() || value.size() != 2) return malformed("gives the tile " + name + " no [x, y]");
  AutowareMetadata::Tile tile{name, value[0].as<double>(), value[1].as<double>()};
  if (!std::isfinite(tile.x) || !std::isfinite(tile.y))
    return malformed("gives the tile " + name + " no place");
  metadata.tiles.push_back(std::move(tile));
  return {};
}

Result<AutowareMetadata> read_document(const YAML::Node& document) {
  AutowareMetadata r;
  if (!document.IsMap()) return malformed("is no map of names to places");
  for (const auto& entry : document) {
    const std::string name = entry.first.as<std::string>();
    if (name == "x_resolution")
      r.x_resolution_m = entry.second.as<double>();
    else if (name == "y_resolution")
      r.y_resolution_m = entry.second.as<double>();
    else
      MAPCODEC_TRY(read_tile(name, entry.second, r));
  }
  if (!(r.x_resolution_m > 0) || !(r.y_resolution_m > 0))
    return malformed("does not say the sides of its tiles (x_resolution, y_resolution)");
  if (r.tiles.empty()) return make_error(ErrorCode::kEmpty, "names no tile");
  return r;
}

std::string number(double v) {
  char buffer[32];
  std::snprintf(buffer, sizeof(buffer), v == std::floor(v) && std::fabs(v) < 1e15 ? "%.0f" : "%.17g", v);
  return buffer;
}

}  // namespace

Result<AutowareMetadata> parse_autoware_metadata(const std::string& text) {
  try {
    return read_document(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    return malformed("is no YAML as Autoware writes it: " + e.msg + " (line " +
                     std::to_string(e.mark.line + 1) + ")");
  } catch (const std::exception& e) {
    return malformed(std::string("cannot be read as YAML: ") + e.what());
  }
}

std::string format_autoware_metadata(const AutowareMetadata& metadata) {
  const auto side = [](double v) { return number(v) + (v == std::floor(v) ? ".0" : ""); };
  std::string r = "x_resolution: " + side(metadata.x_resolution_m) +
                  "\ny_resolution: " + side(metadata.y_resolution_m) + "\n";
  for (const auto& t : metadata.tiles) r += t.file + ": [" + number(t.x) + ", " + number(t.y) + "]\n";
  return r;
}

}  // namespace mapcodec
