// SPDX-License-Identifier: GPL-3.0-or-later
// mapcodecd token add | list | revoke: also while the daemon runs, which sees the change with its next
// request.
#include <spdlog/fmt/fmt.h>

#include <ctime>
#include <nlohmann/json.hpp>

#include "maps/service/catalogue.hpp"
#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/operations/command_line.hpp"
#include "tools/mapcodecd/operations/duration_text.hpp"

namespace mapcodec::daemon {
namespace {

using Json = nlohmann::ordered_json;

struct AddArguments {
  std::string name;
  std::vector<std::string> grants;
  std::string expires;
  bool json = false;
};

Error usage(const std::string& what) {
  return make_error(ErrorCode::kInvalidArgument, what);
}

/// "yard:read", "*:admin".
Result<MapGrant> parse_grant(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const auto right =
      colon == text.npos ? std::nullopt : parse_right(std::string_view(text).substr(colon + 1));
  if (!right) return usage("'" + text + "' is no MAP:RIGHT with read, write or admin");
  return MapGrant{text.substr(0, colon), *right};
}

Result<std::string> add(const AddArguments& a, const DaemonSettings& settings, std::int64_t now_s,
                        std::int64_t& expires_s) {
  std::vector<MapGrant> grants;
  for (const std::string& text : a.grants) {
    MAPCODEC_ASSIGN(MapGrant grant, parse_grant(text));
    grants.push_back(std::move(grant));
  }
  if (!a.expires.empty()) {
    const auto seconds = parse_duration(a.expires);
    if (!seconds) return usage("--expires: '" + a.expires + "' is no time such as 90s, 15m, 12h, 30d");
    expires_s = now_s + *seconds;
  }
  MAPCODEC_ASSIGN(const auto catalogue, Catalogue::open(catalogue_path(settings), settings.retention));
  return catalogue->add_token(a.name, grants, now_s, expires_s);
}

int run_add(const AddArguments& a, const DaemonSettings& settings) {
  std::int64_t expires_s = 0;
  const auto secret = add(a, settings, static_cast<std::int64_t>(std::time(nullptr)), expires_s);
  if (!secret.ok()) return fail(secret.error());
  if (a.json) {
    fmt::print("{}\n", Json({{"name", a.name}, {"token", *secret}, {"expires_s", expires_s}}).dump());
  } else {
    fmt::print("{}\n", *secret);
    fmt::print(stderr, "token '{}', good {}; it is not stored and cannot be shown again\n", a.name,
               expires_s == 0 ? "until revoked" : "until " + date_text(expires_s) + " UTC");
  }
  return 0;
}

Json token_json(const TokenInfo& token, std::int64_t now_s) {
  Json j = {{"name", token.name},
            {"created_s", token.created_s},
            {"expires_s", token.expires_s},
            {"expired", token.expired(now_s)}};
  j["grants"] = Json::object();
  for (const MapGrant& grant : token.grants) j["grants"][grant.map] = right_name(grant.right);
  return j;
}

void print_tokens(const std::vector<TokenInfo>& tokens, std::int64_t now_s) {
  fmt::print("{:<20} {:<20} {:<20} {}\n", "token", "created (UTC)", "expires (UTC)", "rights");
  for (const TokenInfo& token : tokens) {
    std::string rights;
    for (const MapGrant& grant : token.grants) rights += grant.map + ":" + right_name(grant.right) + " ";
    fmt::print("{:<20} {:<20} {:<20} {}{}\n", token.name, date_text(token.created_s),
               date_text(token.expires_s), rights, token.expired(now_s) ? "(expired)" : "");
  }
}

int run_list(bool json, const DaemonSettings& settings) {
  const auto catalogue = Catalogue::open(catalogue_path(settings), settings.retention);
  if (!catalogue.ok()) return fail(catalogue.error());
  const auto tokens = (*catalogue)->tokens();
  if (!tokens.ok()) return fail(tokens.error());
  const auto now_s = static_cast<std::int64_t>(std::time(nullptr));
  if (!json) {
    print_tokens(*tokens, now_s);
    return 0;
  }
  Json list = Json::array();
  for (const TokenInfo& token : *tokens) list.push_back(token_json(token, now_s));
  fmt::print("{}\n", list.dump());
  return 0;
}

int run_revoke(const std::string& name, const DaemonSettings& settings) {
  const auto catalogue = Catalogue::open(catalogue_path(settings), settings.retention);
  if (!catalogue.ok()) return fail(catalogue.error());
  const Status revoked = (*catalogue)->revoke_token(name);
  return revoked.ok() ? 0 : fail(revoked.error());
}

}  // namespace

void add_token_verbs(CLI::App& app, CommandLine& line) {
  CLI::App* token = app.add_subcommand("token", "Who may do what: bearer tokens with rights per map");
  token->require_subcommand(1)->fallthrough();

  auto a = std::make_shared<AddArguments>();
  CLI::App* add_verb = token->add_subcommand("add", "Make a token and print its secret, once")->fallthrough();
  add_verb->add_option("NAME", a->name, "For the list and the log")->required();
  add_verb->add_option("--map", a->grants, "MAP:RIGHT with read, write or admin; MAP may be *")->required();
  add_verb->add_option("--expires", a->expires, "After 90s, 15m, 12h, 30d; never without this");
  add_verb->add_flag("--json", a->json, "As JSON");
  add_verb->callback([a, &line] { line.verb = [a](const DaemonSettings& s) { return run_add(*a, s); }; });

  auto json = std::make_shared<bool>(false);
  CLI::App* list = token->add_subcommand("list", "Tokens and their rights")->fallthrough();
  list->add_flag("--json", *json, "As JSON");
  list->callback(
      [json, &line] { line.verb = [json](const DaemonSettings& s) { return run_list(*json, s); }; });

  auto name = std::make_shared<std::string>();
  CLI::App* revoke = token->add_subcommand("revoke", "From now on a token is refused")->fallthrough();
  revoke->add_option("NAME", *name, "Of the token")->required();
  revoke->callback(
      [name, &line] { line.verb = [name](const DaemonSettings& s) { return run_revoke(*name, s); }; });
}

}  // namespace mapcodec::daemon
