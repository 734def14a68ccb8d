#pragma once

#include <stdexcept>

#include "clients/link/common/address.hpp"

/// The exit codes of subcommands, and the exceptions that main() turns into exit codes.
namespace drivebench::command {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;     ///< the run failed
inline constexpr int kExitUsage = 2;      ///< the command line or a configuration is wrong
inline constexpr int kExitNoConnect = 3;  ///< no server answers, or the bench refuses this client

/// The user can correct it: exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The bench answers and refuses this client: exit code 3.
class NotLetIn : public link::ConnectError {
 public:
  using ConnectError::ConnectError;
};

}  // namespace drivebench::command
