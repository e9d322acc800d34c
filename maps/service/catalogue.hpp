// SPDX-License-Identifier: GPL-3.0-or-later
// What a map service remembers beside its archives: maps and how long to keep their revisions, tokens, jobs.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mapcodec/base/result.hpp"
#include "maps/service/map_catalogue.hpp"
#include "maps/service/tokens.hpp"

namespace mapcodec {

/// A token as listed; the secret itself is nowhere.
struct TokenInfo {
  std::string name;
  std::vector<MapGrant> grants;
  std::int64_t created_s = 0;  ///< [s since epoch]
  std::int64_t expires_s = 0;  ///< [s since epoch], from which on it is refused; 0: never
  [[nodiscard]] bool expired(std::int64_t now_s) const { return expires_s != 0 && now_s >= expires_s; }
};

struct CatalogueMap {
  std::string name;
  std::int64_t created_s = 0;  ///< [s since epoch]
  std::string created_by;      ///< principal
  Retention retention;
};

/// Work in the background, as it went.
struct Job {
  enum class State : std::uint8_t { running, done, failed, interrupted };
  std::int64_t id = 0;
  std::string map;
  std::string kind;  ///< "compact"
  State state = State::running;
  std::int64_t begun_s = 0, ended_s = 0;  ///< [s since epoch]; 0: not yet
  std::string outcome;                    ///< what went wrong; empty: nothing
};

/// One SQLite file in WAL mode, which several processes may have open: the daemon, and the verbs that manage
/// tokens. Every change is on the disk when its function returns. Errors of all functions: CannotWrite (disk
/// full, read-only, locked for 5 s), Unreadable, Malformed (not a catalogue, damaged). Threads: any, one
/// query at a time.
class Catalogue final : public MapCatalogue {
 public:
  /// Opens, or makes with mode 0600. Errors: also Unsupported (of a newer version).
  /// @param defaults  retention of maps that it does not know.
  [[nodiscard]] static Result<std::unique_ptr<Catalogue>> open(const std::string& path,
                                                               const Retention& defaults = {});
  ~Catalogue() override;

  /// @param expires_s  0: never.
  /// @return the secret, which cannot be asked for again.
  /// Errors: Exists (name); InvalidArgument (name empty, longer than 64 or not printable; no grant; a bad map
  /// name; expiry not after now).
  [[nodiscard]] Result<std::string> add_token(const std::string& name, const std::vector<MapGrant>& grants,
                                              std::int64_t now_s, std::int64_t expires_s = 0);
  /// In the order of their names.
  [[nodiscard]] Result<std::vector<TokenInfo>> tokens() const;
  /// From now on the token is refused. Errors: NotFound.
  [[nodiscard]] Status revoke_token(const std::string& name);
  /// What `secret` allows at `now_s`. An empty `map` asks only whether the token has this right for any map.
  [[nodiscard]] Result<TokenDecision> check(std::string_view secret, std::string_view map, Right right,
                                            std::int64_t now_s) const;

  [[nodiscard]] Status created(const std::string& map, const Retention& retention,
                               const std::string& principal) override;
  /// Also the grants and jobs of its name: a later map of that name starts anew.
  [[nodiscard]] Status removed(const std::string& map) override;
  [[nodiscard]] Result<Retention> retention(const std::string& map) override;
  /// Changes that of a map, also of one that was not known. Errors: InvalidArgument.
  [[nodiscard]] Status set_retention(const std::string& map, const Retention& retention);
  [[nodiscard]] Result<std::vector<CatalogueMap>> maps() const;

  [[nodiscard]] Status job(const std::string& map, const std::string& job,
                           const std::string& outcome) override;
  /// Jobs that were running when a process died; for the start of the only process that runs jobs.
  /// @return how many.
  [[nodiscard]] Result<std::int64_t> mark_interrupted_jobs();
  /// The newest first.
  [[nodiscard]] Result<std::vector<Job>> jobs(std::int64_t most = 100) const;

 private:
  struct State;
  explicit Catalogue(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapcodec
