// SPDX-License-Identifier: GPL-3.0-or-later
// The access control of a daemon: tokens of the catalogue, and limits per client.
#pragma once

#include <memory>

#include "maps/service/access.hpp"
#include "maps/service/catalogue.hpp"
#include "maps/service/client_limits.hpp"
#include "maps/service/token_policy.hpp"

namespace mapcodec {

/// Threads: from many at once.
class TokenAccess final : public AccessControl {
 public:
  /// @param catalogue  must outlive this and all admissions. The limits live as long as the last admission.
  TokenAccess(const Catalogue& catalogue, TokenPolicy policy, const LimitSettings& limits);
  ~TokenAccess() override;

  [[nodiscard]] Result<std::unique_ptr<Admission>> admit(const Credentials& who, Right right,
                                                         const std::string& map, CallKind kind) override;
  [[nodiscard]] bool may_read(const Credentials& who, const std::string& map) override;

 private:
  [[nodiscard]] Result<std::string> principal(const Credentials& who, Right right,
                                              const std::string& map) const;
  const Catalogue& catalogue_;
  const TokenPolicy policy_;
  std::shared_ptr<ClientLimits> limits_;
};

/// The address in a peer name of gRPC, without its port: "ipv4:10.0.0.7:4711" -> "10.0.0.7".
[[nodiscard]] std::string peer_address(const std::string& peer);

}  // namespace mapcodec
