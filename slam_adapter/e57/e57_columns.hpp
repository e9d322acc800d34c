// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "slam_adapter/e57/e57_scan.hpp"
#include "slam_adapter/formats/record_plan.hpp"

namespace mapcodec {

/// What of every scan goes into the records, in which type: chosen so that no scan loses a bit of it.
struct E57Columns {
  struct Column {
    std::string field;  ///< as E57 calls it
    RecordField record;
  };
  std::vector<Column> columns;  ///< without coordinates
  RecordPlan plan;
  std::vector<std::string> warnings;

  /// Errors: Malformed (a scan without coordinates), Unsupported.
  [[nodiscard]] static Result<E57Columns> choose(const E57Description& description);
};

/// "cartesianX", "cartesianY", "cartesianZ", or range, azimuth and elevation; empty if it has neither.
[[nodiscard]] std::vector<std::string> coordinate_fields(const E57Scan& scan);

}  // namespace mapcodec
