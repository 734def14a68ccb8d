#include "server/config/grants.hpp"

#include <openssl/crypto.h>
#include <openssl/sha.h>

#include <algorithm>

#include "protocols/document.hpp"
#include "protocols/text.hpp"
#include "server/config/strict_table.hpp"
#include "server/config/words.hpp"
#include "server/host/wall_time.hpp"

namespace drivebench {
namespace {

constexpr std::size_t kMaxTokens = 1000;
constexpr std::size_t kMaxToken = 200;
constexpr std::size_t kMaxTokensFile = 262'144;

bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

std::optional<TokenHash> hash_of_digits(std::string_view digits) {
  TokenHash hash{};
  if (digits.size() != 2 * hash.size()) return std::nullopt;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    const char c = digits[i];
    const bool letter = c >= 'a' && c <= 'f';
    if (!letter && (c < '0' || c > '9')) return std::nullopt;
    hash[i / 2] = static_cast<unsigned char>(hash[i / 2] << 4 | (letter ? c - 'a' + 10 : c - '0'));
  }
  return hash;
}

/// Reads the token or its hash. Problems name the entry and never show the secret.
void read_secret(StrictTable& entry, Grant& grant) {
  const auto token = entry.text("token", kMaxToken);
  const auto digits = entry.text("sha256", kMaxToken);
  if (entry.has("token") == entry.has("sha256")) {
    entry.report("token", "or sha256: there must be one of them");
  } else if (token) {
    if (!is_printable(*token)) entry.report("token", "may hold printable ASCII characters only");
    grant.hash = hash_of_token(*token);
  } else if (digits) {
    const auto hash = hash_of_digits(*digits);
    if (!hash) entry.report("sha256", "must be 64 of the digits 0 to 9 and a to f");
    grant.hash = hash.value_or(TokenHash{});
  }
}

Grant read_grant(StrictTable& entry) {
  Grant grant;
  for (const std::string_view key : {"name", "role"})
    entry.require(key);
  grant.name = entry.identifier("name").value_or("");
  if (const auto role = entry.choice("role", kRoleWords)) grant.role = static_cast<Role>(*role + 1);
  read_secret(entry, grant);
  if (const auto until = entry.text("until", 64)) {
    grant.until = parse_rfc3339(*until);
    if (!grant.until) {
      entry.report("until",
                   "is \"" + printable(*until) + "\" but must be a time as \"2026-11-22T18:00:00Z\"");
    }
  }
  grant.revoked = entry.boolean("revoked").value_or(false);
  entry.finish();
  return grant;
}

}  // namespace

std::string_view name_of(Role role) noexcept {
  return kRoleWords[static_cast<std::size_t>(role) - 1];
}

TokenHash hash_of_token(std::string_view token) noexcept {
  TokenHash hash{};
  ::SHA256(reinterpret_cast<const unsigned char*>(token.data()), token.size(), hash.data());
  return hash;
}

std::vector<Grant> load_grants(const std::filesystem::path& path) {
  const std::string name = path.string();
  FileText file = read_file(path, kMaxTokensFile);
  if (!file.why_not.empty()) throw ConfigError({{name, 0, {}, file.why_not}});
  if (file.others_may_read) throw ConfigError({{name, 0, {}, "may be read by others: chmod 600 it"}});
  ProblemList problems;
  std::vector<Grant> grants;
  if (const auto document = parse_document(file.text, name, problems)) {
    StrictTable root(&*document, "", 1, name, problems);
    root.require("token");
    for (StrictTable& entry : root.tables("token", kMaxTokens)) {
      Grant grant = read_grant(entry);
      const bool known = std::any_of(grants.begin(), grants.end(),
                                     [&](const Grant& other) { return other.hash == grant.hash; });
      if (known) entry.report("name", "has the token of another entry");
      grants.push_back(std::move(grant));
    }
    root.finish();
  }
  ::OPENSSL_cleanse(file.text.data(), file.text.size());
  problems.throw_if_any();
  return grants;
}

const Grant* find_grant(std::span<const Grant> grants, std::string_view token) noexcept {
  const TokenHash hash = hash_of_token(token);
  const Grant* found = nullptr;
  for (const Grant& grant : grants) {
    if (::CRYPTO_memcmp(grant.hash.data(), hash.data(), hash.size()) == 0) found = &grant;
  }
  return found;
}

}  // namespace drivebench
