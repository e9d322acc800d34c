// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/verbs/bag_flags.hpp"

#include <map>
#include <string>

namespace mapcodec::cli {

void add_bag_flags(CLI::App& verb, BagOptions& options) {
  static const std::map<std::string, BagOptions::Poses> kNames{{"auto", BagOptions::Poses::automatic},
                                                               {"tf", BagOptions::Poses::tf},
                                                               {"odometry", BagOptions::Poses::odometry},
                                                               {"none", BagOptions::Poses::none}};
  auto* group = verb.add_option_group("bag", "ROS bags");
  group->add_option("--topic", options.topics, "Clouds of this topic alone; may be given again")->expected(1);
  group
      ->add_option_function<std::string>(
          "--poses", [&options](const std::string& name) { options.poses = kNames.at(name); },
          "Of the scans: tf, odometry, none (as they lie), or auto, the first that knows any")
      ->check(CLI::IsMember({"auto", "tf", "odometry", "none"}))
      ->default_str("auto");
  group->add_option("--frame", options.frame,
                    "The frame that becomes the map's; default the root of tf's tree");
}

}  // namespace mapcodec::cli
