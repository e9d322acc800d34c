// SPDX-License-Identifier: GPL-3.0-or-later
#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string original, decoded;
  bool json = false;
  int threads = 0;
};

int run(const Arguments& a) {
  Arena arena(a.threads);
  const auto original = load_any(a.original, arena);
  if (!original.ok()) return fail(a.original, original.error());
  const auto decoded = load_any(a.decoded, arena);
  if (!decoded.ok()) return fail(a.decoded, decoded.error());
  TbbRunner runner(arena);
  const auto e = evaluate(original->cloud, decoded->cloud, runner, {});
  if (!e.ok()) return fail(a.decoded, e.error());
  std::uint64_t raw = decoded->raw_bytes;
  if (raw == 0) raw = 12 * std::uint64_t(original->cloud.size());
  if (a.json) {
    fmt::print("{}\n", evaluation_json(*e, decoded->bytes, raw).dump(2));
  } else {
    print_evaluation(*e);
    fmt::print("{:<12} {}, {:.3f} bits per point, ratio {:.4f}\n", "size", human_bytes(decoded->bytes),
               8.0 * double(decoded->bytes) / double(e->points_original),
               double(decoded->bytes) / double(raw));
  }
  return kDone;
}

}  // namespace

void add_evaluate(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("evaluate", "How far a decoded cloud or a map is from its original");
  verb->add_option("ORIGINAL", a->original, "Points in any format")->required();
  verb->add_option("DECODED", a->decoded, "Points in any format, or an archive")->required();
  verb->add_flag("--json", a->json, "As JSON");
  verb->add_option("--threads", a->threads, "0: all cores")->check(CLI::Range(0, 1024));
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
