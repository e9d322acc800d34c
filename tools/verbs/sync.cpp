// SPDX-License-Identifier: GPL-3.0-or-later
// sync: a copy of a map of a service, which fetches only what differs.
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "slam_adapter/client/map_replica.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, copy;
  bool follow = false, json = false;
};

void print(const Arguments& a, const ReplicaReport& r) {
  if (a.json) {
    const Json line{{"revision", r.revision},
                    {"tiles_fetched", r.tiles_fetched},
                    {"tiles_removed", r.tiles_removed},
                    {"bytes_fetched", r.bytes_fetched},
                    {"bytes_whole", r.bytes_whole}};
    fmt::print("{}\n", line.dump());
  } else {
    fmt::print("{}: revision {}, {} tiles fetched ({} of {}), {} removed\n", a.copy, r.revision,
               r.tiles_fetched, human_bytes(r.bytes_fetched), human_bytes(r.bytes_whole), r.tiles_removed);
  }
  std::fflush(stdout);
}

int run(const Arguments& a) {
  const auto client = MapClient::connect(a.map);
  if (!client.ok()) return fail(a.map, client.error());
  auto replica = MapReplica::open(*client, a.copy);
  if (!replica.ok()) return fail(a.copy, replica.error());
  if (!a.follow) {
    const auto report = replica->catch_up();
    if (!report.ok()) return fail(a.map, report.error());
    print(a, *report);
    return kDone;
  }
  const std::atomic<bool>* stop = stop_flag();
  const Status s = replica->follow(stop, [&](const ReplicaReport& r) {
    print(a, r);
    return !*stop;
  });
  return s.ok() || *stop ? kDone : fail(a.map, s.error());
}

}  // namespace

void add_sync(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      app.add_subcommand("sync", "Brings a copy of a map of a service up to date: fetches what differs");
  verb->add_option("MAP", a->map, "mapcodec://HOST:PORT/MAP")->required();
  verb->add_option("COPY", a->copy, "The archive here; made if there is none")->required();
  verb->add_flag("--follow", a->follow, "Goes on as the map changes, until it is stopped");
  verb->add_flag("--json", a->json, "A line of JSON for each step");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
