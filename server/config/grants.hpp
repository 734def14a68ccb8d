#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace drivebench {

/// The rights of a session; each role includes those before it.
enum class Role : std::uint32_t { kViewer = 1, kOperator = 2, kConductor = 3, kAdmin = 4 };
std::string_view name_of(Role role) noexcept;

/// The SHA-256 of a token. The server keeps only the hashes.
using TokenHash = std::array<unsigned char, 32>;
TokenHash hash_of_token(std::string_view token) noexcept;

/// An entry of the tokens file: the subject to whom a token belongs.
struct Grant {
  std::string name{};
  Role role = Role::kViewer;
  TokenHash hash{};
  std::optional<std::chrono::sys_seconds> until{};  ///< the token is valid until then; none: for ever
  bool revoked = false;

  bool holds_at(std::chrono::system_clock::time_point now) const noexcept {
    return !revoked && (!until || now < *until);
  }
  friend bool operator==(const Grant&, const Grant&) = default;
};

/// Reads a tokens file: a regular file that only its owner can read. Throws ConfigError.
std::vector<Grant> load_grants(const std::filesystem::path& file);

/// The grant of a token, or null. The time does not depend on the token, so that it shows no part of a valid
/// one.
const Grant* find_grant(std::span<const Grant> grants, std::string_view token) noexcept;

}  // namespace drivebench
