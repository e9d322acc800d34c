// SPDX-License-Identifier: GPL-3.0-or-later
#include "parallel/arena.hpp"

#include <algorithm>
#include <utility>

#include "parallel/tbb_arena.hpp"

namespace mapcodec {

Arena::Arena(int threads) : impl_(std::make_unique<Impl>()) {
  impl_->owned = std::make_unique<tbb::task_arena>(threads > 0 ? threads : int{tbb::task_arena::automatic});
  impl_->arena = impl_->owned.get();
}

Arena::Arena(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Arena::~Arena() = default;
Arena::Arena(Arena&&) noexcept = default;
Arena& Arena::operator=(Arena&&) noexcept = default;

int Arena::threads() const {
  return std::max(1, impl_->arena->max_concurrency());
}

void Arena::execute(const std::function<void()>& work) {
  impl_->arena->execute(work);
}

}  // namespace mapcodec
