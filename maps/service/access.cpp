// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/access.hpp"

namespace mapcodec {
namespace {

class OpenAdmission final : public Admission {
 public:
  [[nodiscard]] const std::string& principal() const override {
    static const std::string name = "anonymous";
    return name;
  }
  [[nodiscard]] Status charge(std::uint64_t) override { return {}; }
};

class OpenAccess final : public AccessControl {
 public:
  [[nodiscard]] Result<std::unique_ptr<Admission>> admit(const Credentials&, Right, const std::string&,
                                                         CallKind) override {
    return std::unique_ptr<Admission>(std::make_unique<OpenAdmission>());
  }
  [[nodiscard]] bool may_read(const Credentials&, const std::string&) override { return true; }
};

}  // namespace

std::unique_ptr<AccessControl> open_access() {
  return std::make_unique<OpenAccess>();
}

}  // namespace mapcodec
