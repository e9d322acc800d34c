// SPDX-License-Identifier: GPL-3.0-or-later
#include "slam_adapter/rms_account.hpp"

#include <algorithm>
#include <cmath>

#include "mapcodec/base/byte_reader.hpp"
#include "mapcodec/base/byte_writer.hpp"
#include "mapcodec/quality/novelty.hpp"

namespace mapcodec {
namespace {

double root_mean(double sum, double count) {
  return count > 0 ? std::sqrt(std::max(0.0, sum) / count) : 0;
}

// Of the promise, squared: what novelty reckons that folding adds where pending points stand for others.
constexpr double kReckoned = kFoldedShare * kFoldedShare;
// So much of it folding may spend: the rest is for scans that come again and are worse than the average.
constexpr double kSpent = 0.99;

}  // namespace

RmsAccount::RmsAccount(const MapInfo& info, double promise_m, double stored)
    : promise_m_(promise_m), came_(double(info.input_points)), stored_(stored) {
  const double achieved = info.achieved.rms_m;
  forward_m2_ = achieved * achieved * came_;
  backward_m2_ = achieved * achieved * stored_;
  const auto at = info.extras.find(kRmsAccountExtra);
  if (at != info.extras.end()) read(at->second, achieved);
}

void RmsAccount::read(ByteSpan extra, double achieved_m) {
  ByteReader in(extra);
  const double forward = in.f64(), backward = in.f64();
  const std::uint64_t pending = in.varint();
  const double larger = std::max(forward, backward);
  // A writer that knows nothing of accounts may have gone on since.
  const bool fits =
      in.ok() && forward >= 0 && backward >= 0 && std::abs(larger - achieved_m) <= 1e-6 * larger;
  if (!fits) return;
  forward_m2_ = forward * forward * came_;
  backward_m2_ = backward * backward * stored_;
  pending_ = std::min(double(pending), stored_);
}

void RmsAccount::add(const Entry& e) {
  came_ += e.added + e.known;
  stored_ += e.added;
  forward_m2_ += e.known_m2 + e.added * e.forward_m * e.forward_m;
  backward_m2_ += e.added * e.backward_m * e.backward_m;
  if (e.pending) pending_ += e.added;
}

double RmsAccount::excess_m2(double known, double known_m2) const {
  const double limit = promise_m_ * promise_m_;
  return forward_m2_ + known_m2 + pending_ * kReckoned * limit - limit * (came_ + known);
}

double RmsAccount::folding_rms_m() const {
  const double usual = kFoldedShare * promise_m_;
  if (!(pending_ > 0)) return usual;
  const double limit = promise_m_ * promise_m_ * kSpent;
  const double backward = (limit * stored_ - backward_m2_) / pending_;
  const double left = limit * came_ - forward_m2_;
  double forward = left / pending_;
  const double reckoned = kReckoned * promise_m_ * promise_m_;
  // Beyond what was reckoned, points that pending ones stand for get more, too; that all known ones are such
  // is the worst case.
  const double known = std::max(0.0, came_ - stored_);
  if (forward > reckoned) forward = (left + known * reckoned) / (pending_ + known);
  const double square = std::min(forward, backward);
  // A map that is above its promise already is no reason to code what comes ever more exactly.
  return square > reckoned ? std::sqrt(square) : std::max(std::sqrt(std::max(0.0, square)), 0.9 * usual);
}

void RmsAccount::fold(double points, double forward_m, double backward_m) {
  const double more = std::max(0.0, forward_m * forward_m - kReckoned * promise_m_ * promise_m_);
  const double share = pending_ > 0 ? std::min(1.0, points / pending_) : 0;
  const double known = std::max(0.0, came_ - stored_);
  forward_m2_ += points * forward_m * forward_m + share * known * more;
  backward_m2_ += points * backward_m * backward_m;
  pending_ = std::max(0.0, pending_ - points);
}

double RmsAccount::rms_m() const {
  return std::max(root_mean(forward_m2_, came_), root_mean(backward_m2_, stored_));
}

std::optional<Bytes> RmsAccount::extra() const {
  if (!(promise_m_ > 0) || !(pending_ > 0)) return std::nullopt;
  ByteWriter out;
  out.f64(root_mean(forward_m2_, came_));
  out.f64(root_mean(backward_m2_, stored_));
  out.varint(static_cast<std::uint64_t>(pending_));
  return out.take();
}

}  // namespace mapcodec
