// SPDX-License-Identifier: GPL-3.0-or-later
#include "mapcodec/quality/plane_error.hpp"

#include <Eigen/Dense>

#include "mapcodec/cloud/normals.hpp"

namespace mapcodec {
namespace {

using Normal = Eigen::Vector3d;
using Normals = std::vector<Normal>;

Normal to_eigen(const Vec3& p) {
  return {p[0], p[1], p[2]};
}

const Channel* normal_channel(const PointCloud& cloud) {
  const Channel* c = cloud.find("normal");
  return c != nullptr && is_normals(c->info) && c->size() == cloud.size() ? c : nullptr;
}

Normal stored_normal(const Channel& channel, std::size_t i) {
  Normal n;
  for (std::size_t d = 0; d < 3; ++d) {
    n[Eigen::Index(d)] =
        channel.info.scalar == ScalarType::f32 ? double(channel.get<float>(i, d)) : channel.get<double>(i, d);
  }
  const double length = n.norm();
  return length > 0 ? Normal(n / length) : n;
}

/// Direction of least spread.
Normal fit_normal(const std::vector<Vec3>& points, std::span<const std::uint32_t> ids) {
  Normal mean = Normal::Zero();
  for (const std::uint32_t i : ids) mean += to_eigen(points[i]);
  mean /= static_cast<double>(ids.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const std::uint32_t i : ids) {
    const Normal d = to_eigen(points[i]) - mean;
    scatter += d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(scatter);
  return solver.eigenvectors().col(0);
}

Normals fitted_normals(const PointCloud& cloud, const NeighborIndex& index, std::size_t knn, Runner& runner) {
  Normals normals(cloud.size());
  runner.run(cloud.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> ids(std::min(knn, cloud.size()));
    std::vector<double> squared(ids.size());
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t found = index.nearest(cloud.xyz[i], ids, squared);
      normals[i] = fit_normal(cloud.xyz, {ids.data(), found});
    }
  });
  return normals;
}

Normals original_normals(const NeighborPair& pair, int knn, Runner& runner) {
  const Channel* channel = normal_channel(pair.original);
  const auto k = static_cast<std::size_t>(std::max(knn, 1));
  if (channel == nullptr) return fitted_normals(pair.original, pair.original_index, k, runner);
  Normals normals(pair.original.size());
  for (std::size_t i = 0; i < normals.size(); ++i) normals[i] = stored_normal(*channel, i);
  return normals;
}

Normals decoded_normals(const NeighborPair& pair, const Normals& original) {
  Normals sums(pair.decoded.size(), Normal::Zero());
  for (std::size_t i = 0; i < original.size(); ++i) {
    // Fitted normals have no side: turn each to the side of the sum so far.
    Normal& sum = sums[pair.to_decoded.index[i]];
    sum += sum.dot(original[i]) < 0 ? Normal(-original[i]) : original[i];
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const double length = sums[i].norm();
    sums[i] = length > 1e-12 ? Normal(sums[i] / length) : original[pair.to_original.index[i]];
  }
  return sums;
}

double mean_squared(const std::vector<Vec3>& from, const std::vector<Vec3>& to, const Nearest& nearest,
                    const Normals& normals) {
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const std::uint32_t j = nearest.index[i];
    const double e = (to_eigen(from[i]) - to_eigen(to[j])).dot(normals[j]);
    sum += e * e;
  }
  return sum / static_cast<double>(from.size());
}

}  // namespace

double plane_mean_squared_error(const NeighborPair& pair, int knn, Runner& runner) {
  const Normals original = original_normals(pair, knn, runner);
  const Normals decoded = decoded_normals(pair, original);
  return std::max(mean_squared(pair.original.xyz, pair.decoded.xyz, pair.to_decoded, decoded),
                  mean_squared(pair.decoded.xyz, pair.original.xyz, pair.to_original, original));
}

}  // namespace mapcodec
