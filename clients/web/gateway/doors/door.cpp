#include "clients/web/gateway/doors/door.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <vector>

namespace drivebench::web {
namespace {

constexpr std::size_t kMaxAuthorization = 1024;

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

bool is_own_host(const Door& door, std::string_view host) {
  if (!door.address.is_loopback) return !host.empty();  // the certificate vouches for the name
  const std::string port = ":" + std::to_string(door.address.port);
  const std::array<std::string, 4> own = {"localhost" + port, "127.0.0.1" + port, "[::1]" + port,
                                          to_string(door.address)};
  return std::ranges::find(own, lower_case(host)) != own.end();
}

bool is_allowed_origin(const Door& door, const Visitor& visitor) {
  if (visitor.origin.empty()) return true;  // no browser
  const std::string origin = lower_case(visitor.origin);
  const auto is_same = [&origin](const std::string& allowed) { return lower_case(allowed) == origin; };
  if (visitor.is_foxglove && std::ranges::any_of(door.foxglove_origins, is_same)) return true;
  return origin == (door.tls ? "https://" : "http://") + lower_case(visitor.host);
}

/// What stands behind the colon of `USER:PASSWORD` in base64; empty if there is no such thing.
std::string password_in(std::string_view base64) {
  if (base64.empty() || base64.size() % 4 != 0) return {};
  std::vector<unsigned char> bytes(base64.size() / 4 * 3 + 1);
  const int size = EVP_DecodeBlock(bytes.data(), reinterpret_cast<const unsigned char*>(base64.data()),
                                   static_cast<int>(base64.size()));
  if (size < 0) return {};
  std::string text(bytes.begin(), bytes.begin() + size);
  for (std::size_t i = base64.size(); i > base64.size() - 2 && base64[i - 1] == '='; --i)
    text.pop_back();
  const std::size_t colon = text.find(':');
  return colon == std::string::npos ? std::string() : text.substr(colon + 1);
}

bool has_token(std::string_view authorization, const std::string& token) {
  constexpr std::string_view kBearer = "bearer ";
  constexpr std::string_view kBasic = "basic ";
  if (authorization.size() > kMaxAuthorization) return false;
  std::string given;
  if (const std::string lower = lower_case(authorization); lower.starts_with(kBearer)) {
    given = authorization.substr(kBearer.size());
  } else if (lower.starts_with(kBasic)) {
    given = password_in(authorization.substr(kBasic.size()));
  }
  return given.size() == token.size() && CRYPTO_memcmp(given.data(), token.data(), token.size()) == 0;
}

}  // namespace

std::optional<DoorRefusal> refusal_of(const Door& door, const Visitor& visitor) {
  if (!is_own_host(door, visitor.host)) {
    return DoorRefusal{
        .status = 421, .name = "host", .sentence = "the Host of the request is no name of this gateway"};
  }
  if (!is_allowed_origin(door, visitor)) {
    return DoorRefusal{
        .status = 403, .name = "origin", .sentence = "the Origin of the request is not this page"};
  }
  if (!door.token.empty() && !has_token(visitor.authorization, door.token)) {
    return DoorRefusal{.status = 401,
                       .name = "token",
                       .sentence = "a token is needed: as Bearer, or as the password of any user"};
  }
  return std::nullopt;
}

bool is_origin(std::string_view text) {
  if (text == "file://") return true;
  const std::size_t colon = text.find("://");
  if (colon == 0 || colon == std::string_view::npos) return false;
  const std::string_view host = text.substr(colon + 3);
  return !host.empty() && host.find_first_of("/?#@* ,") == std::string_view::npos;
}

}  // namespace drivebench::web
