// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/catalogue_state.hpp"

namespace mapcodec {
namespace {

/// Ended jobs beyond 200 are forgotten: the catalogue must not grow for ever.
constexpr const char* kForgetOld =
    "DELETE FROM jobs WHERE state <> 0 AND id <= (SELECT max(id) FROM jobs) - 200";

Status begin_job(Database& database, const std::string& map, const std::string& kind) {
  MAPCODEC_ASSIGN(Statement begin,
                  database.prepare("INSERT INTO jobs(map, kind, state, begun_s) VALUES(?, ?, 0, ?)"));
  MAPCODEC_TRY(begin.bind(map, kind, now_s()).run());
  return database.execute(kForgetOld);
}

}  // namespace

Status Catalogue::job(const std::string& map, const std::string& job, const std::string& outcome) {
  const std::lock_guard lock(state_->mutex);
  if (outcome == "begun") return begin_job(state_->database, map, job);
  const bool done = outcome == "done";
  MAPCODEC_ASSIGN(Statement end,
                  state_->database.prepare("UPDATE jobs SET state = ?, outcome = ?, ended_s = ? "
                                           "WHERE state = 0 AND map = ? AND kind = ?"));
  return end
      .bind(static_cast<std::int64_t>(done ? Job::State::done : Job::State::failed),
            done ? std::string() : outcome, now_s(), map, job)
      .run();
}

Result<std::int64_t> Catalogue::mark_interrupted_jobs() {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement mark,
                  state_->database.prepare("UPDATE jobs SET state = ?, ended_s = ? WHERE state = 0"));
  MAPCODEC_TRY(mark.bind(static_cast<std::int64_t>(Job::State::interrupted), now_s()).run());
  return state_->database.changes();
}

Result<std::vector<Job>> Catalogue::jobs(std::int64_t most) const {
  const std::lock_guard lock(state_->mutex);
  MAPCODEC_ASSIGN(Statement query,
                  state_->database.prepare("SELECT id, map, kind, state, begun_s, ended_s, outcome "
                                           "FROM jobs ORDER BY id DESC LIMIT ?"));
  query.bind(most);
  std::vector<Job> jobs;
  for (;;) {
    MAPCODEC_ASSIGN(const bool row, query.step());
    if (!row) return jobs;
    jobs.push_back({query.integer(0), query.text(1), query.text(2), static_cast<Job::State>(query.integer(3)),
                    query.integer(4), query.integer(5), query.text(6)});
  }
}

}  // namespace mapcodec
