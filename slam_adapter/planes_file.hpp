// SPDX-License-Identifier: GPL-3.0-or-later
// The surfaces of an archive as files for other programs: planes as JSON, a mesh as PLY.
#pragma once

#include <string>

#include "slam_adapter/map_file.hpp"
#include "slam_adapter/planes_json.hpp"

namespace mapcodec {

struct SurfaceOptions {
  double tolerance_m = 0;            ///< of merging planes and of closing slits; 0: what the map suggests
  bool cylinders = false;            ///< look for them, too
  std::uint64_t least_points = 100;  ///< of a plane or cylinder
  bool ascii = false;                ///< the mesh as text
};

struct SurfaceReport {
  std::uint64_t points = 0;        ///< of the tiles that were read
  std::uint64_t patch_points = 0;  ///< of those, on patches
  std::uint64_t patches = 0;
  std::uint64_t tiles_read = 0;
  std::uint64_t tiles_without = 0;  ///< whose codec keeps no surface: nothing of them is in the file
  std::uint64_t bytes_read = 0;
  double tolerance_m = 0;  ///< that was used
  double seconds = 0;
  std::uint64_t planes = 0, plane_points = 0, cylinders = 0, cylinder_points = 0;  ///< planes only
  std::uint64_t vertices = 0, faces = 0;                                           ///< mesh only
};

/// The surfaces in `region`, merged.
/// Errors: those of MapFile::read_patches; Unsupported (no tile keeps surfaces; cylinders without CGAL);
/// Empty (no surface in the region).
[[nodiscard]] Result<MapPrimitives> find_primitives(const MapFile& map, const Region& region,
                                                    const ReadSettings& settings,
                                                    const SurfaceOptions& options, SurfaceReport& report);

/// Writes find_primitives as primitives_json. There is never a half file. Errors: also CannotWrite.
[[nodiscard]] Result<SurfaceReport> decompress_planes(const std::string& map_path, const std::string& path,
                                                      const Region& region,
                                                      std::optional<std::uint64_t> revision,
                                                      const ReadSettings& settings,
                                                      const SurfaceOptions& options);

/// Writes the surfaces in `region` as one mesh (weld_patches, write_mesh_ply) to a .ply file. Errors: as
/// above; InvalidArgument (another extension).
[[nodiscard]] Result<SurfaceReport> decompress_mesh(const std::string& map_path, const std::string& path,
                                                    const Region& region,
                                                    std::optional<std::uint64_t> revision,
                                                    const ReadSettings& settings,
                                                    const SurfaceOptions& options);

}  // namespace mapcodec
