// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "mapcodec/base/result.hpp"
#include "slam_adapter/mesh_weld.hpp"

namespace mapcodec {

struct MeshWriteOptions {
  bool ascii = false;
  bool doubles = false;  ///< coordinates as double: far from the origin, float has not the millimetres
};

/// Writes a PLY file with elements `vertex` (x y z, and red green blue where the mesh has colours) and `face`
/// (vertex_indices). There is never a half file. Errors: CannotWrite.
[[nodiscard]] Status write_mesh_ply(const std::string& path, const SurfaceMesh& mesh,
                                    const MeshWriteOptions& options);

}  // namespace mapcodec
