// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "slam_adapter/mesh_weld.hpp"

namespace mapcodec {

/// Turns faces round so that neighbours show the same side: two faces that share an edge with no third run
/// along it in opposite senses. Of each connected piece the side that more of its area showed before stays.
/// Where a piece has only one side, or more than two faces meet, some neighbours still disagree.
/// Deterministic. Threads: pure.
void orient_faces(SurfaceMesh& mesh);

}  // namespace mapcodec
