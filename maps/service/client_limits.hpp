// SPDX-License-Identifier: GPL-3.0-or-later
// How much one client may ask of a service: requests and bytes per second, streams at once.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace mapcodec {

/// 0 of anything: without limit.
struct LimitSettings {
  double requests_per_s = 0;
  double request_burst = 0;  ///< requests at once after a rest; at least 1 where requests_per_s is set
  double bytes_per_s = 0;    ///< in both directions together
  double byte_burst = 0;
  std::uint32_t open_streams = 0;  ///< of one client
  std::size_t clients = 65536;     ///< that are remembered; beyond it those that rested longest are forgotten
};

/// Buckets that fill with time [Turner 1986, leaky bucket as a meter], one pair per client. A client is the
/// name of its token, or its address where it has none. Bytes are charged after the fact, so a bucket can
/// fall below zero: the next request then waits until it has filled up again. Threads: any.
class ClientLimits {
 public:
  using Clock = std::chrono::steady_clock;

  enum class Refusal : std::uint8_t { none, rate, bytes, streams };
  enum class Kind : std::uint8_t { request, stream };

  /// A running request or an open stream, which gives its place back when it ends. Must not outlive the
  /// limits.
  class Ticket {
   public:
    Ticket() = default;
    Ticket(Ticket&& other) noexcept;
    Ticket& operator=(Ticket&& other) noexcept;
    ~Ticket();
    /// Counts bytes that were sent or received.
    void charge(std::uint64_t bytes, Clock::time_point now = Clock::now());
    /// Time until the byte bucket is no longer below zero: how long a polite stream pauses.
    [[nodiscard]] Clock::duration debt(Clock::time_point now = Clock::now()) const;

   private:
    friend class ClientLimits;
    Ticket(ClientLimits* limits, std::string client, Kind kind)
        : limits_(limits), client_(std::move(client)), kind_(kind) {}
    void release();
    ClientLimits* limits_ = nullptr;
    std::string client_;
    Kind kind_ = Kind::request;
  };

  struct Admission {
    Refusal refusal = Refusal::none;
    Clock::duration retry_after{};  ///< of a refused one: when it is worth trying again
    Ticket ticket;                  ///< of an admitted one
    [[nodiscard]] bool admitted() const { return refusal == Refusal::none; }
  };

  explicit ClientLimits(const LimitSettings& settings);
  ClientLimits(const ClientLimits&) = delete;
  ClientLimits& operator=(const ClientLimits&) = delete;
  ~ClientLimits();

  /// Asks for one request or stream; both count as a request.
  [[nodiscard]] Admission admit(std::string_view client, Kind kind, Clock::time_point now = Clock::now());
  /// Of all clients.
  [[nodiscard]] std::size_t remembered_clients() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "too many requests", "too many bytes", "too many open streams"; empty for none.
[[nodiscard]] std::string_view to_string(ClientLimits::Refusal refusal);

}  // namespace mapcodec
