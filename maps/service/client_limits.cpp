// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/client_limits.hpp"

#include <algorithm>
#include <list>
#include <map>
#include <mutex>
#include <utility>

namespace mapcodec {
namespace {

using Clock = ClientLimits::Clock;
using Refusal = ClientLimits::Refusal;
using Kind = ClientLimits::Kind;

/// What is left of a budget that fills at a steady rate up to its burst.
class Bucket {
 public:
  Bucket(double per_s, double burst) : per_s_(per_s), burst_(std::max(burst, 1.0)), level_(burst_) {}

  void fill(double seconds) { level_ = std::min(burst_, level_ + per_s_ * seconds); }
  void take(double amount) {
    if (limited()) level_ -= amount;
  }
  [[nodiscard]] bool limited() const { return per_s_ > 0; }
  /// Time until `amount` is there.
  [[nodiscard]] Clock::duration until(double amount) const {
    if (!limited() || level_ >= amount) return {};
    // More than a day is a day: the figure becomes a header and a timer.
    const double seconds = std::min((amount - level_) / per_s_, 86400.0);
    return std::chrono::ceil<std::chrono::milliseconds>(std::chrono::duration<double>(seconds));
  }

 private:
  double per_s_, burst_, level_;
};

struct Client {
  Bucket requests, bytes;
  std::uint32_t open = 0;
  Clock::time_point seen;
  std::list<std::string>::iterator place;  ///< in the order of use

  void fill(Clock::time_point now) {
    const double seconds = std::chrono::duration<double>(now - seen).count();
    if (seconds <= 0) return;  // two threads may bring their times in the wrong order
    requests.fill(seconds);
    bytes.fill(seconds);
    seen = now;
  }
};

}  // namespace

struct ClientLimits::State {
  explicit State(const LimitSettings& s) : settings(s) {}
  const LimitSettings settings;
  mutable std::mutex mutex;
  std::map<std::string, Client, std::less<>> clients;
  std::list<std::string> order;  ///< the longest unused first

  Client& client(std::string_view name, Clock::time_point now) {
    auto found = clients.find(name);
    if (found == clients.end()) {
      forget_idle();
      const auto place = order.emplace(order.end(), name);
      Client fresh{{settings.requests_per_s, settings.request_burst},
                   {settings.bytes_per_s, settings.byte_burst},
                   0,
                   now,
                   place};
      found = clients.emplace(std::string(name), fresh).first;
    }
    order.splice(order.end(), order, found->second.place);
    found->second.fill(now);
    return found->second;
  }

  /// Makes room for one more. Those with open streams stay: there are never more of them than connections.
  void forget_idle() {
    auto oldest = order.begin();
    while (clients.size() >= settings.clients && oldest != order.end()) {
      const auto found = clients.find(*oldest);
      if (found->second.open > 0) {
        ++oldest;
        continue;
      }
      clients.erase(found);
      oldest = order.erase(oldest);
    }
  }

  [[nodiscard]] Refusal refusal(const Client& c, Kind kind) const {
    if (kind == Kind::stream && settings.open_streams > 0 && c.open >= settings.open_streams)
      return Refusal::streams;
    if (c.requests.until(1) > Clock::duration{}) return Refusal::rate;
    if (c.bytes.until(0) > Clock::duration{}) return Refusal::bytes;
    return Refusal::none;
  }
};

ClientLimits::ClientLimits(const LimitSettings& settings) : state_(std::make_unique<State>(settings)) {}
ClientLimits::~ClientLimits() = default;

ClientLimits::Admission ClientLimits::admit(std::string_view name, Kind kind, Clock::time_point now) {
  const std::lock_guard lock(state_->mutex);
  Client& client = state_->client(name, now);
  Admission admission;
  admission.refusal = state_->refusal(client, kind);
  switch (admission.refusal) {
    case Refusal::rate:
      admission.retry_after = client.requests.until(1);
      break;
    case Refusal::bytes:
      admission.retry_after = client.bytes.until(0);
      break;
    case Refusal::streams:
      admission.retry_after = std::chrono::seconds(1);
      break;
    case Refusal::none:
      client.requests.take(1);
      if (kind == Kind::stream) ++client.open;
      admission.ticket = Ticket(this, std::string(name), kind);
      break;
  }
  return admission;
}

std::size_t ClientLimits::remembered_clients() const {
  const std::lock_guard lock(state_->mutex);
  return state_->clients.size();
}

ClientLimits::Ticket::Ticket(Ticket&& other) noexcept
    : limits_(std::exchange(other.limits_, nullptr)), client_(std::move(other.client_)), kind_(other.kind_) {}

ClientLimits::Ticket& ClientLimits::Ticket::operator=(Ticket&& other) noexcept {
  if (this == &other) return *this;
  release();
  limits_ = std::exchange(other.limits_, nullptr);
  client_ = std::move(other.client_);
  kind_ = other.kind_;
  return *this;
}

ClientLimits::Ticket::~Ticket() {
  release();
}

void ClientLimits::Ticket::release() {
  ClientLimits* limits = std::exchange(limits_, nullptr);
  if (limits == nullptr || kind_ == Kind::request) return;
  State& state = *limits->state_;
  const std::lock_guard lock(state.mutex);
  if (const auto found = state.clients.find(client_); found != state.clients.end()) --found->second.open;
}

void ClientLimits::Ticket::charge(std::uint64_t bytes, Clock::time_point now) {
  if (limits_ == nullptr) return;
  State& state = *limits_->state_;
  const std::lock_guard lock(state.mutex);
  state.client(client_, now).bytes.take(static_cast<double>(bytes));
}

Clock::duration ClientLimits::Ticket::debt(Clock::time_point now) const {
  if (limits_ == nullptr) return {};
  State& state = *limits_->state_;
  const std::lock_guard lock(state.mutex);
  return state.client(client_, now).bytes.until(0);
}

std::string_view to_string(ClientLimits::Refusal refusal) {
  switch (refusal) {
    case Refusal::none:
      return "";
    case Refusal::rate:
      return "too many requests";
    case Refusal::bytes:
      return "too many bytes";
    case Refusal::streams:
      return "too many open streams";
  }
  return "";
}

}  // namespace mapcodec
