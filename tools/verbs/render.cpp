// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render.hpp"

#include <spdlog/fmt/fmt.h>

#include <memory>

#include "tools/verbs/report.hpp"
#include "tools/verbs/verbs.hpp"

namespace mapcodec::cli {
namespace {

struct Arguments {
  std::string original, decoded, output;
};

int run(const Arguments& a) {
  Arena arena(0);
  const auto left = load_any(a.original, arena);
  if (!left.ok()) return fail(a.original, left.error());
  const auto right = load_any(a.decoded, arena);
  if (!right.ok()) return fail(a.decoded, right.error());
  RenderSettings settings;
  settings.left_caption = "original " + human_bytes(left->bytes);
  settings.right_caption = "decoded " + human_bytes(right->bytes);
  const Status s = render_side_by_side(left->cloud, right->cloud, settings, a.output);
  if (!s.ok()) return fail(a.output, s.error());
  fmt::print("{}\n", a.output);
  return kDone;
}

}  // namespace

void add_render(CLI::App& app, Action& action) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = app.add_subcommand("render", "A PNG with two clouds side by side");
  verb->add_option("ORIGINAL", a->original, "Points in any format, or an archive")->required();
  verb->add_option("DECODED", a->decoded, "The same")->required();
  verb->add_option("-o,--output", a->output, "PNG to write")->required();
  verb->callback([a, &action] { action = [a] { return run(*a); }; });
}

}  // namespace mapcodec::cli
