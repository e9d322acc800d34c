// SPDX-License-Identifier: GPL-3.0-or-later
// Draco's k-d tree coder at its slowest speed (-cl 10), on the integers of our grid.
#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/point_cloud/point_cloud_builder.h>

#include "tools/peers/grid.hpp"
#include "tools/peers/peer_list.hpp"

namespace mapcodec::peers {
namespace {

Error failed(const draco::Status& status) {
  return make_error(ErrorCode::kUnsupported, "draco: " + status.error_msg_string());
}

std::unique_ptr<draco::PointCloud> to_draco(const Grid& grid) {
  draco::PointCloudBuilder builder;
  builder.Start(static_cast<draco::PointIndex::ValueType>(grid.cells.size()));
  const int id = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_UINT32);
  builder.SetAttributeValuesForAllPoints(id, grid.cells.data(), sizeof(VoxelCoord));
  return builder.Finalize(false);
}

draco::Status encode(const draco::PointCloud& cloud, draco::EncoderBuffer& to) {
  draco::ExpertEncoder encoder(cloud);
  encoder.SetEncodingMethod(draco::POINT_CLOUD_KD_TREE_ENCODING);
  encoder.SetSpeedOptions(0, 0);
  return encoder.EncodeToBuffer(&to);
}

std::vector<Vec3> positions(const draco::PointCloud& cloud, const Grid& grid) {
  std::vector<Vec3> r(cloud.num_points());
  const draco::PointAttribute* attribute = cloud.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  for (std::uint32_t i = 0; i < r.size(); ++i) {
    VoxelCoord cell{};
    attribute->GetMappedValue(draco::PointIndex(i), cell.data());
    r[i] = grid.centre(cell);
  }
  return r;
}

Result<PeerRun> run_draco(const std::vector<Vec3>& points, double step_m) {
  MAPCODEC_ASSIGN(const Grid grid, make_grid(points, step_m));
  PeerRun run;
  const StopWatch encoding;
  draco::EncoderBuffer buffer;
  if (const draco::Status s = encode(*to_draco(grid), buffer); !s.ok()) return failed(s);
  run.encode_seconds = encoding.seconds();
  run.bytes = buffer.size();

  const StopWatch decoding;
  draco::DecoderBuffer in;
  in.Init(buffer.data(), buffer.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodePointCloudFromBuffer(&in);
  if (!decoded.ok()) return failed(decoded.status());
  run.decode_seconds = decoding.seconds();
  run.decoded = positions(*decoded.value(), grid);
  return run;
}

}  // namespace

void add_draco(std::vector<Peer>& to) {
  to.push_back({"draco", false, true, run_draco});
}

}  // namespace mapcodec::peers
