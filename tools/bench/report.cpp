// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/report.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

namespace mapcodec::bench {

Status write_text(const std::string& path, const std::string& text) {
  std::ofstream out(path, std::ios::binary);
  out << text;
  out.close();
  if (out) return {};
  return make_error(ErrorCode::kCannotWrite, path + ": cannot be written");
}

Report::Report(const BenchSettings& settings, std::string name, int threads)
    : folder_(settings.report), name_(std::move(name)) {
  json_["bench"] = name_;
  json_["machine"] = machine_json(threads);
  json_["notes"] = Json::array();
  line(fmt::format("# mapcodec bench {}", name_));
  line("");
  line(machine_text(threads) + ".");
  line("");
}

Status Report::begin() const {
  std::error_code failed;
  std::filesystem::create_directories(folder_, failed);
  if (failed) return make_error(ErrorCode::kCannotWrite, folder_ + ": " + failed.message());
  return {};
}

void Report::row(const std::vector<std::string>& cells) {
  std::string text = "|";
  for (const std::string& c : cells) text.append(" ").append(c).append(" |");
  line(text);
}

void Report::table(const std::vector<std::string>& head) {
  line("");
  row(head);
  std::string rule = "|";
  for (std::size_t i = 0; i < head.size(); ++i) rule += "---|";
  line(rule);
}

void Report::note(const std::string& text) {
  Json& notes = json_["notes"];
  if (std::find(notes.begin(), notes.end(), Json(text)) == notes.end()) notes.push_back(text);
}

Status Report::plot(const std::vector<Plot>& plots, const std::string& suffix) {
  const std::string file = fmt::format("{}{}{}.png", name_, suffix.empty() ? "" : "_", suffix);
  const Status s = write_plots(plots, fmt::format("{}/{}", folder_, file));
  if (!s.ok() && s.error().code != ErrorCode::kUnsupported) return s;
  if (s.ok()) {
    line("");
    line(fmt::format("![{}]({})", file, file));
  } else {
    note(s.error().message);
  }
  return {};
}

Status Report::finish() {
  const Json notes = json_["notes"];
  if (!notes.empty()) line("");
  for (const Json& n : notes) line(fmt::format("- {}", n.get<std::string>()));
  MAPCODEC_TRY(write_text(fmt::format("{}/{}.json", folder_, name_), json_.dump(1) + "\n"));
  return write_text(fmt::format("{}/{}.md", folder_, name_), markdown_);
}

std::string digits(double value, int count) {
  if (!std::isfinite(value)) return "-";
  if (value == 0) return "0";
  const int before = static_cast<int>(std::floor(std::log10(std::abs(value)))) + 1;
  return fmt::format("{:.{}f}", value, std::clamp(count - before, 0, 12));
}

}  // namespace mapcodec::bench
