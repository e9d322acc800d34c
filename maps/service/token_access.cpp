// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/token_access.hpp"

#include <ctime>

namespace mapcodec {
namespace {

constexpr const char* kLocalPrincipal = "local";

Error busy(const ClientLimits::Refusal refusal, ClientLimits::Clock::duration wait) {
  const auto wait_ms = std::chrono::duration_cast<std::chrono::milliseconds>(wait).count();
  return make_error(ErrorCode::kBusy, std::string(to_string(refusal)) + " of one client; try again in " +
                                          std::to_string(wait_ms) + " ms");
}

class LimitedAdmission final : public Admission {
 public:
  LimitedAdmission(std::string principal, std::shared_ptr<ClientLimits> limits, ClientLimits::Ticket ticket)
      : principal_(std::move(principal)), limits_(std::move(limits)), ticket_(std::move(ticket)) {}

  [[nodiscard]] const std::string& principal() const override { return principal_; }

  [[nodiscard]] Status charge(std::uint64_t bytes) override {
    const auto now = ClientLimits::Clock::now();
    const auto debt = ticket_.debt(now);
    if (debt > ClientLimits::Clock::duration{}) return busy(ClientLimits::Refusal::bytes, debt);
    ticket_.charge(bytes, now);
    return {};
  }

 private:
  std::string principal_;
  std::shared_ptr<ClientLimits> limits_;  // before the ticket: goes away after it
  ClientLimits::Ticket ticket_;
};

}  // namespace

TokenAccess::TokenAccess(const Catalogue& catalogue, TokenPolicy policy, const LimitSettings& limits)
    : catalogue_(catalogue), policy_(policy), limits_(std::make_shared<ClientLimits>(limits)) {}
TokenAccess::~TokenAccess() = default;

Result<std::string> TokenAccess::principal(const Credentials& who, Right right,
                                           const std::string& map) const {
  if (who.token.empty() && who.local && policy_ == TokenPolicy::remote) return std::string(kLocalPrincipal);
  MAPCODEC_ASSIGN(TokenDecision decision,
                  catalogue_.check(who.token, map, right, static_cast<std::int64_t>(std::time(nullptr))));
  if (!decision.granted()) return refusal(decision.state);
  return std::move(decision.token);
}

Result<std::unique_ptr<Admission>> TokenAccess::admit(const Credentials& who, Right right,
                                                      const std::string& map, CallKind kind) {
  auto name = principal(who, right, map);
  if (!name.ok()) {
    // Guesses cost the guesser: they count for the address that they come from.
    auto counted = limits_->admit("@" + peer_address(who.peer), ClientLimits::Kind::request);
    if (!counted.admitted()) return busy(counted.refusal, counted.retry_after);
    return name.error();
  }
  const auto wanted = kind == CallKind::stream ? ClientLimits::Kind::stream : ClientLimits::Kind::request;
  auto admission = limits_->admit(*name, wanted);
  if (!admission.admitted()) return busy(admission.refusal, admission.retry_after);
  return std::unique_ptr<Admission>(
      std::make_unique<LimitedAdmission>(std::move(name).value(), limits_, std::move(admission.ticket)));
}

bool TokenAccess::may_read(const Credentials& who, const std::string& map) {
  return principal(who, Right::read, map).ok();
}

std::string peer_address(const std::string& peer) {
  const std::size_t scheme = peer.find(':'), port = peer.rfind(':');
  if (scheme == peer.npos) return peer;
  if (scheme == port) return peer.substr(0, scheme);  // "unix:"
  return peer.substr(scheme + 1, port - scheme - 1);
}

}  // namespace mapcodec
