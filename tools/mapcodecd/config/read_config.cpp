// SPDX-License-Identifier: GPL-3.0-or-later
#include <toml++/toml.h>

#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/config/settings_table.hpp"

namespace mapcodec::daemon {
namespace {

std::string place(const toml::source_region& region) {
  return " (line " + std::to_string(region.begin.line) + ", column " + std::to_string(region.begin.column) +
         ")";
}

/// Puts what the file says into the settings, and remembers the first thing that is wrong.
class Reader {
 public:
  explicit Reader(const toml::table& root) : root_(root) {}

  void section(const char* name, const char*) {
    section_ = name;
    table_ = nullptr;
    const toml::node* node = root_.get(name);
    if (node == nullptr) return;
    table_ = node->as_table();
    if (table_ == nullptr) fail(*node, section_ + " is a table: [" + section_ + "]");
  }

  template <class Value>
  void value(const char* key, Value& place, const char*, Range range) {
    known_[section_].insert(key);
    const toml::node* node = table_ == nullptr ? nullptr : table_->get(key);
    if (node != nullptr) read(*node, section_ + "." + key, place, range);
  }

  /// After all sections: what the file says and nobody asked for.
  [[nodiscard]] Status finish() {
    for (const auto& [name, node] : root_) {
      const auto section = known_.find(std::string(name.str()));
      if (section == known_.end()) {
        fail(node, "unknown section '" + std::string(name.str()) + "'");
      } else if (const toml::table* table = node.as_table()) {
        check_keys(*table, section->second, section->first);
      }
    }
    return error_ ? Status(*error_) : Status();
  }

 private:
  void check_keys(const toml::table& table, const std::set<std::string>& keys, const std::string& section) {
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      if (!keys.contains(name)) fail(node, "unknown key '" + section + "." + name + "'");
    }
  }

  void fail(const toml::node& node, const std::string& what) {
    if (!error_) error_ = make_error(ErrorCode::kInvalidArgument, what + place(node.source()));
  }

  [[nodiscard]] bool within(const toml::node& node, const std::string& name, double value, Range range) {
    if (value >= range.least && value <= range.most) return true;  // NaN is not
    std::string bounds = std::to_string(range.least);
    bounds = bounds.substr(0, bounds.find_last_not_of("0") + 1);
    fail(node, name + " is out of range: at least " + bounds + "..., at most " +
                   std::to_string(static_cast<std::int64_t>(range.most)));
    return false;
  }

  void read(const toml::node& node, const std::string& name, std::string& out, Range) {
    if (const auto value = node.value_exact<std::string>()) {
      if (value->find('\0') != value->npos) return fail(node, name + " must not hold a zero byte");
      out = *value;
    } else {
      fail(node, name + " is a string");
    }
  }
  void read(const toml::node& node, const std::string& name, bool& out, Range) {
    if (const auto value = node.value_exact<bool>()) {
      out = *value;
    } else {
      fail(node, name + " is true or false");
    }
  }
  void read(const toml::node& node, const std::string& name, double& out, Range range) {
    const auto value = node.value<double>();
    if (!value || !node.is_number()) return fail(node, name + " is a number");
    if (within(node, name, *value, range)) out = *value;
  }
  template <class Integer>
  requires std::is_integral_v<Integer>
  void read(const toml::node& node, const std::string& name, Integer& out, Range range) {
    const auto value = node.value_exact<std::int64_t>();
    if (!value) return fail(node, name + " is a whole number");
    range.most = std::min(range.most, static_cast<double>(std::numeric_limits<Integer>::max()));
    if (within(node, name, static_cast<double>(*value), range)) out = static_cast<Integer>(*value);
  }
  void read(const toml::node& node, const std::string& name, std::vector<std::string>& out, Range) {
    const toml::array* list = node.as_array();
    if (list == nullptr) return fail(node, name + " is a list of strings");
    out.clear();
    for (const toml::node& entry : *list) read(entry, name, out.emplace_back(), Range{});
  }
  void read(const toml::node& node, const std::string& name, TokenPolicy& out, Range) {
    const auto word = node.value_exact<std::string>();
    if (word == "required") {
      out = TokenPolicy::required;
    } else if (word == "remote") {
      out = TokenPolicy::remote;
    } else {
      fail(node, name + " is \"remote\" or \"required\"");
    }
  }

  const toml::table& root_;
  const toml::table* table_ = nullptr;
  std::string section_;
  std::map<std::string, std::set<std::string>> known_;
  std::optional<Error> error_;
};

Result<toml::table> parse_toml(const std::string& text) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& e) {
    return make_error(ErrorCode::kMalformed, std::string(e.description()) + place(e.source()));
  } catch (const std::exception& e) {
    return make_error(ErrorCode::kMalformed, e.what());
  }
}

}  // namespace

Result<DaemonSettings> parse_config(const std::string& text) {
  MAPCODEC_ASSIGN(const toml::table root, parse_toml(text));
  DaemonSettings settings;
  Reader reader(root);
  visit_settings(settings, reader);
  MAPCODEC_TRY(reader.finish());
  settings.http.tls = settings.grpc.tls;
  settings.http.insecure = settings.grpc.insecure;
  return settings;
}

Result<DaemonSettings> read_config(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return make_error(ErrorCode::kNotFound, "cannot be read, or does not exist");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (file.bad()) return make_error(ErrorCode::kUnreadable, "cannot be read");
  return parse_config(text);
}

}  // namespace mapcodec::daemon
