#pragma once

#include <stdexcept>

#include "clients/link/common/address.hpp"

/// How a subcommand ends: its exit code, or one of these exceptions, which main() turns into one.
namespace drivebench::command {

inline constexpr int kExitOk = 0;
inline constexpr int kExitFailed = 1;     ///< the run failed
inline constexpr int kExitUsage = 2;      ///< the command line or a configuration is wrong
inline constexpr int kExitNoConnect = 3;  ///< nothing answers, or the bench turns this client away

/// The user can correct it: exit code 2.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The bench answers and turns this client away: exit code 3, as if nothing answered.
class NotLetIn : public link::ConnectError {
 public:
  using ConnectError::ConnectError;
};

}  // namespace drivebench::command
