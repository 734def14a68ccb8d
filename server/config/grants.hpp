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

/// What somebody may do; each role may do what those before it may.
enum class Role : std::uint32_t { kViewer = 1, kOperator = 2, kAdmin = 3 };
std::string_view name_of(Role role) noexcept;

/// SHA-256 of a token. What the server keeps: the tokens themselves are forgotten when they are read.
using TokenHash = std::array<unsigned char, 32>;
TokenHash hash_of_token(std::string_view token) noexcept;

/// An entry of the tokens file: whoever has the token is this subject.
struct Grant {
  std::string name{};
  Role role = Role::kViewer;
  TokenHash hash{};
  std::optional<std::chrono::sys_seconds> until{};  ///< end of the subject's slot; none: no end
  bool revoked = false;

  bool holds_at(std::chrono::system_clock::time_point now) const noexcept {
    return !revoked && (!until || now < *until);
  }
  friend bool operator==(const Grant&, const Grant&) = default;
};

/// Reads a tokens file: regular, and nobody but its owner may read it. Throws ConfigError.
std::vector<Grant> load_grants(const std::filesystem::path& file);

/// The grant of this token, or null. Takes the same time whichever it is, and how much of it is right.
const Grant* find_grant(std::span<const Grant> grants, std::string_view token) noexcept;

}  // namespace drivebench
