// SPDX-License-Identifier: GPL-3.0-or-later
// Memory that is reserved before it is taken.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <utility>

namespace mapcodec {

/// Counts bytes against a limit. Threads: all methods from many at once; takes no lock.
class MemoryBudget {
 public:
  explicit MemoryBudget(std::uint64_t limit) : limit_(limit) {}

  /// Takes `bytes` if the limit allows it.
  [[nodiscard]] bool take(std::uint64_t bytes) {
    std::uint64_t used = used_.load();
    do {
      if (bytes > limit_ || used > limit_ - bytes) return false;
    } while (!used_.compare_exchange_weak(used, used + bytes));
    note_peak(used + bytes);
    return true;
  }
  void give_back(std::uint64_t bytes) { used_.fetch_sub(bytes); }

  [[nodiscard]] std::uint64_t limit() const { return limit_; }
  [[nodiscard]] std::uint64_t used() const { return used_.load(); }
  [[nodiscard]] std::uint64_t peak() const { return peak_.load(); }

 private:
  void note_peak(std::uint64_t used) {
    std::uint64_t peak = peak_.load();
    while (peak < used && !peak_.compare_exchange_weak(peak, used)) {
    }
  }

  const std::uint64_t limit_;
  std::atomic<std::uint64_t> used_{0}, peak_{0};
};

/// Bytes of a budget, given back when this goes away: with the last holder of what they were taken for.
class Reservation {
 public:
  Reservation() = default;
  Reservation(Reservation&& other) noexcept
      : budget_(std::move(other.budget_)), bytes_(std::exchange(other.bytes_, 0)) {}
  Reservation& operator=(Reservation&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Reservation() {
    if (budget_) budget_->give_back(bytes_);
  }

  /// Nothing is reserved if the budget does not allow it: then `bytes()` is 0.
  [[nodiscard]] static Reservation of(const std::shared_ptr<MemoryBudget>& budget, std::uint64_t bytes) {
    Reservation r;
    if (budget->take(bytes)) {
      r.budget_ = budget;
      r.bytes_ = bytes;
    }
    return r;
  }
  /// Makes it more or less. @return false if the budget does not allow more; then it stays as it is.
  [[nodiscard]] bool resize(std::uint64_t bytes) {
    if (!budget_ || (bytes > bytes_ && !budget_->take(bytes - bytes_))) return false;
    if (bytes < bytes_) budget_->give_back(bytes_ - bytes);
    bytes_ = bytes;
    return true;
  }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  std::shared_ptr<MemoryBudget> budget_;
  std::uint64_t bytes_ = 0;
};

}  // namespace mapcodec
