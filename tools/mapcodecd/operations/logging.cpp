// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mapcodecd/operations/logging.hpp"

#include <spdlog/formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

namespace mapcodec::daemon {
namespace {

using Json = nlohmann::ordered_json;

/// Fields of the line that this thread is about to write. The sink works in the caller's thread.
thread_local const std::initializer_list<LogField>* fields_of_line = nullptr;

std::string dumped(const Json& j) {
  return j.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json json_value(const LogField& field) {
  return std::visit([](const auto& value) { return Json(value); }, field.value);
}

/// As a JSON string where it holds anything but plain characters.
std::string plain_or_quoted(std::string_view text) {
  const auto plain = [](char c) { return c > ' ' && c < 127 && c != '"' && c != '=' && c != '\\'; };
  if (!text.empty() && std::all_of(text.begin(), text.end(), plain)) return std::string(text);
  return dumped(Json(text));
}

/// Control characters would start lines of their own or steer a terminal.
std::string one_line(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (static_cast<unsigned char>(c) >= 32 && c != 127) {
      out += c;
    } else {
      out += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  return out;
}

std::string time_text(spdlog::log_clock::time_point time) {
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(ms / 1000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[32];
  const std::size_t length = std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%S", &utc);
  return fmt::format("{}.{:03}Z", std::string_view(text, length), ms % 1000);
}

std::string_view level_text(spdlog::level::level_enum level) {
  const auto text = spdlog::level::to_string_view(level);
  return {text.data(), text.size()};
}

class JsonLines final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    Json j;
    j["time"] = time_text(message.time);
    j["level"] = level_text(message.level);
    j["message"] = std::string_view(message.payload.data(), message.payload.size());
    if (fields_of_line != nullptr) {
      for (const LogField& field : *fields_of_line) j[std::string(field.key)] = json_value(field);
    }
    const std::string line = dumped(j) + "\n";
    out.append(line.data(), line.data() + line.size());
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override { return std::make_unique<JsonLines>(); }
};

class TextLines final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    std::string line = time_text(message.time) + " " + std::string(level_text(message.level)) + " " +
                       one_line({message.payload.data(), message.payload.size()});
    if (fields_of_line != nullptr) {
      for (const LogField& field : *fields_of_line) {
        const auto* text = std::get_if<std::string_view>(&field.value);
        line += " " + std::string(field.key) + "=" +
                (text != nullptr ? plain_or_quoted(*text) : dumped(json_value(field)));
      }
    }
    line += "\n";
    out.append(line.data(), line.data() + line.size());
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override { return std::make_unique<TextLines>(); }
};

spdlog::level::level_enum spdlog_level(LogLevel level) {
  switch (level) {
    case LogLevel::trace:
      return spdlog::level::trace;
    case LogLevel::debug:
      return spdlog::level::debug;
    case LogLevel::info:
      return spdlog::level::info;
    case LogLevel::warn:
      return spdlog::level::warn;
    case LogLevel::error:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

}  // namespace

Status start_logging(const LogSettings& settings) {
  const auto level = spdlog::level::from_str(settings.level);
  if (level == spdlog::level::off && settings.level != "off") {
    return make_error(ErrorCode::kInvalidArgument, "log.level: '" + settings.level + "' is no level");
  }
  auto logger =
      std::make_shared<spdlog::logger>("mapcodecd", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  if (settings.json) {
    logger->set_formatter(std::make_unique<JsonLines>());
  } else {
    logger->set_formatter(std::make_unique<TextLines>());
  }
  logger->set_level(level);
  spdlog::set_default_logger(std::move(logger));
  return {};
}

void log_event(LogLevel level, std::string_view message, std::initializer_list<LogField> fields) {
  fields_of_line = &fields;
  spdlog::default_logger_raw()->log(spdlog_level(level),
                                    spdlog::string_view_t(message.data(), message.size()));
  fields_of_line = nullptr;
}

void log_request(const RequestRecord& r, LogLevel level) {
  log_event(level, "request",
            {{"id", r.id},
             {"transport", r.transport},
             {"method", r.method},
             {"code", r.code},
             {"bytes_in", static_cast<std::int64_t>(r.bytes_in)},
             {"bytes_out", static_cast<std::int64_t>(r.bytes_out)},
             {"ms", std::round(r.seconds * 1e6) / 1e3},
             {"principal", r.principal},
             {"peer", r.peer},
             {"error", r.error}});
}

}  // namespace mapcodec::daemon
