// SPDX-License-Identifier: GPL-3.0-or-later
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>

#include "tools/mapcodecd/config/config.hpp"
#include "tools/mapcodecd/config/listen_address.hpp"
#include "tools/mapcodecd/tls/tls_context.hpp"

namespace mapcodec::daemon {
namespace {

using Findings = std::vector<std::string>;

void check_addresses(const std::string& section, const std::vector<std::string>& listen, bool tls,
                     bool insecure, Findings& findings) {
  for (const std::string& text : listen) {
    const auto address = parse_listen_address(text);
    const Status allowed = address.ok() ? check_listen(*address, tls, insecure) : Status(address.error());
    if (!allowed.ok()) findings.push_back(section + ".listen: " + allowed.error().message);
  }
}

void check_folder(const std::string& folder, Findings& findings) {
  struct stat status {};
  if (folder.empty()) {
    findings.emplace_back("storage.folder: not given");
  } else if (stat(folder.c_str(), &status) != 0 || !S_ISDIR(status.st_mode)) {
    findings.push_back("storage.folder: '" + folder + "' is no folder");
  } else if (access(folder.c_str(), W_OK | X_OK) != 0) {
    findings.push_back("storage.folder: '" + folder + "' cannot be written to");
  }
}

void check_tls(const TlsSettings& tls, Findings& findings) {
  if (!tls.enabled() && tls.key_file.empty() && tls.client_ca_file.empty()) return;
  const auto context = TlsContext::open(tls);
  if (!context.ok()) findings.push_back("tls: " + context.error().message);
}

}  // namespace

std::vector<std::string> check_config(const DaemonSettings& settings) {
  Findings findings;
  check_folder(settings.service.folder, findings);
  check_tls(settings.grpc.tls, findings);
  if (settings.grpc.listen.empty() && settings.http.listen.empty())
    findings.emplace_back("grpc.listen: no address");
  check_addresses("grpc", settings.grpc.listen, settings.grpc.tls.enabled(), settings.grpc.insecure,
                  findings);
  check_addresses("http", settings.http.listen, settings.http.tls.enabled(), settings.http.insecure,
                  findings);
  constexpr const char* kLevels[] = {"trace", "debug", "info", "warn", "error", "off"};
  if (std::find(std::begin(kLevels), std::end(kLevels), settings.log.level) == std::end(kLevels)) {
    findings.push_back("log.level: '" + settings.log.level + "' is no level");
  }
  return findings;
}

std::string catalogue_path(const DaemonSettings& settings) {
  return settings.access.catalogue.empty() ? settings.service.folder + "/catalogue.db"
                                           : settings.access.catalogue;
}

}  // namespace mapcodec::daemon
