// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/runner.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <algorithm>

#include "parallel/turn.hpp"

namespace mapcodec {
namespace {

/// Pieces per thread: enough that an unlucky thread does not hold up the others, few enough to cost nothing.
constexpr std::size_t kPiecesPerThread = 8;

}  // namespace

void TbbRunner::run(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) {
  if (count == 0) return;
  const std::size_t pieces = kPiecesPerThread * static_cast<std::size_t>(arena_.threads());
  const std::size_t grain = std::max<std::size_t>(1, count / pieces);
  parallel_detail::Turn start, end;
  start.pass();
  arena_.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, count, grain),
        [&](const tbb::blocked_range<std::size_t>& r) {
          const parallel_detail::TurnScope scope(start, end);
          body(r.begin(), r.end());
        },
        tbb::simple_partitioner());
  });
  end.take();
}

}  // namespace mapcodec
