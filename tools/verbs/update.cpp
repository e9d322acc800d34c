// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/update.hpp"

#include <chrono>
#include <memory>

#include "tools/verbs/bag_flags.hpp"
#include "tools/verbs/change.hpp"
#include "tools/verbs/history.hpp"
#include "tools/verbs/remote.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string map, pose, effort = "fast";
  std::optional<double> rms, max_error;
  bool lossless = false, all = false, json = false, create = false;
  double tile_size_m = 0;
  int threads = 0;
  UpdateRequest request;
};

Status complete(Arguments& a) {
  UpdateRequest& r = a.request;
  if (!a.pose.empty()) {
    MAPCODEC_ASSIGN(r.pose, parse_pose(a.pose));
  }
  if (a.rms) r.promise = PromiseKind::rms, r.promise_m = *a.rms;
  if (a.max_error) r.promise = PromiseKind::max_error, r.promise_m = *a.max_error;
  if (a.lossless) r.promise = PromiseKind::lossless;
  r.settings.effort = a.effort == "fast"   ? Effort::fast
                      : a.effort == "high" ? Effort::high
                                           : Effort::standard;
  r.settings.density_cap = !a.all;
  r.settings.stop = stop_flag();
  r.timestamp_s = commit_time();
  if (!a.create) return {};
  CompressOptions o;
  if (r.promise) o.promise = *r.promise, o.promise_m = r.promise_m;
  o.color_error = r.color_error.value_or(o.color_error);
  o.tile_size_m = a.tile_size_m;
  o.unit_m = r.unit_m;
  o.bag = r.bag;
  o.stop = stop_flag();
  r.create = o;
  return {};
}

int run(Arguments& a) {
  if (const Status s = complete(a); !s.ok()) {
    fail("update", s.error());
    return kUsage;
  }
  const auto begin = std::chrono::steady_clock::now();
  Arena arena(a.threads);
  std::vector<std::string> warnings;
  const auto report = is_remote(a.map) ? update_remote(a.map, a.request, warnings)
                                       : update_files(a.map, a.request, arena, warnings);
  if (!report.ok()) return fail(a.map, report.error());
  print_change(a.map, *report, warnings,
               std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), a.json);
  return kDone;
}

}  // namespace

void add_update(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("update", "Adds points to a map, in place, as one revision");
  verb->add_option("MAP", a->map, "The archive")->required();
  verb->add_option("INPUT", a->request.inputs, "Files of points")->required();
  verb->add_option("--pose", a->pose,
                   "T_map_points as x,y,z,qx,qy,qz,qw [m]; of the submap, if one is named");
  verb->add_option("--submap", a->request.submap, "Into this submap, in its frame; made if there is none");
  auto* promise =
      verb->add_option_group("promise", "What the map is believed to promise; another is refused");
  promise->add_option("--rms", a->rms, "[m]")->check(CLI::PositiveNumber);
  promise->add_option("--max-error", a->max_error, "[m]")->check(CLI::PositiveNumber);
  promise->add_flag("--lossless", a->lossless, "Every bit");
  promise->require_option(0, 1);
  verb->add_option("--color-error", a->request.color_error, "Believed, as the promise")
      ->check(CLI::NonNegativeNumber);
  auto* create =
      verb->add_flag("--create", a->create,
                     "Begins the map if it is not there, with the promise given (default --rms 0.01)");
  verb->add_option("--tile-size", a->tile_size_m, "Of a map that is begun [m]")
      ->check(CLI::PositiveNumber)
      ->needs(create);
  verb->add_flag("--all-points", a->all,
                 "Adds also what lies on stored surfaces at the density they have already");
  verb->add_option("--effort", a->effort, "Of the new segments until they are folded: fast, default, high")
      ->check(CLI::IsMember({"fast", "default", "high"}))
      ->capture_default_str();
  verb->add_flag("--each-scan", a->request.each_scan,
                 "ROS bags: each cloud becomes a submap TOPIC@STAMP with its pose, in the sensor's frame");
  add_bag_flags(*verb, a->request.bag);
  verb->add_option("--unit", a->request.unit_m, "Metres per unit of the input")->check(CLI::PositiveNumber);
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->add_flag("--json", a->json, "Summary as JSON on stdout");
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
