// SPDX-License-Identifier: GPL-3.0-or-later
// The service's maps coded by MapUpdater: the same code as the command line's.
#pragma once

#include "maps/service/map_coding.hpp"
#include "slam_adapter/map_updater.hpp"

namespace mapcodec {

class UpdaterCoding final : public MapCoding {
 public:
  /// @param arena  must outlive this and all editors.
  explicit UpdaterCoding(Arena& arena, const UpdateSettings& settings = {})
      : arena_(arena), settings_(settings) {}

  /// Where there is a sample, everything is chosen for it as `create_map` does; else the lattice is that of
  /// the promise alone.
  [[nodiscard]] Status create(const std::string& path, const NewMap& map) override;
  [[nodiscard]] Result<std::unique_ptr<MapEditor>> edit(const std::string& path,
                                                        const std::atomic<bool>* stop) override;
  [[nodiscard]] Status check(const PointCloud& points, const MapSchema& schema) const override;
  [[nodiscard]] Result<PointCloud> decode(const std::vector<ByteSpan>& segments, const MapSchema& schema,
                                          std::optional<unsigned> level,
                                          const DecodeLimits& limits) const override;
  [[nodiscard]] Result<std::uint64_t> bytes_of_level(ByteSpan base, const MapSchema& schema,
                                                     unsigned level) const override;

 private:
  Arena& arena_;
  UpdateSettings settings_;
};

}  // namespace mapcodec
