// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>

#include "mapcodec/base/bytes.hpp"

namespace mapcodec::fuzz {

/// Writes FOLDER/<target>/<number>.
class SeedFolder {
 public:
  explicit SeedFolder(std::filesystem::path root) : root_(std::move(root)) {
    std::filesystem::remove_all(root_);
  }

  /// A new file's name, for who writes it otherwise.
  [[nodiscard]] std::string next_path(const std::string& target) {
    std::filesystem::create_directories(root_ / target);
    ++count_;
    return (root_ / target / std::to_string(number_[target]++)).string();
  }
  void write(const std::string& target, ByteSpan bytes) {
    std::ofstream file(next_path(target), std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    good_ = good_ && file.good();
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] bool good() const { return good_; }

 private:
  std::filesystem::path root_;
  std::map<std::string, int> number_;
  std::size_t count_ = 0;
  bool good_ = true;
};

}  // namespace mapcodec::fuzz
