// SPDX-License-Identifier: GPL-3.0-or-later
#include "maps/service/token_secret.hpp"

#include <openssl/evp.h>
#include <sys/random.h>

namespace mapcodec {
namespace {

constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/// Base64 with the letters of URLs, without padding.
std::string to_letters(const std::array<std::uint8_t, 32>& bytes) {
  std::string text;
  std::uint32_t held = 0;
  int bits = 0;
  for (const std::uint8_t byte : bytes) {
    held = (held << 8) | byte;
    for (bits += 8; bits >= 6; bits -= 6) text += kLetters[(held >> (bits - 6)) & 63];
  }
  return bits > 0 ? text + kLetters[(held << (6 - bits)) & 63] : text;
}

}  // namespace

Result<std::string> make_token_secret() {
  std::array<std::uint8_t, 32> random{};
  if (getrandom(random.data(), random.size(), 0) != static_cast<ssize_t>(random.size())) {
    return make_error(ErrorCode::kUnreadable, "the system gives no random numbers");
  }
  return "mct_" + to_letters(random);
}

Result<TokenHash> hash_token(std::string_view secret) {
  TokenHash hash{};
  if (EVP_Digest(secret.data(), secret.size(), hash.data(), nullptr, EVP_sha256(), nullptr) != 1) {
    return make_error(ErrorCode::kUnsupported, "the crypto library refuses SHA-256");
  }
  return hash;
}

}  // namespace mapcodec
