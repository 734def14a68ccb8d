#pragma once

#include <string>
#include <vector>

#include "clients/command/can/can_netlink.hpp"

namespace drivebench::command {

struct CanCheckOptions {
  std::string interface {};
  bool json = false;
  bool classic = false;  ///< classic frames will do: no FD is no problem
};

/// Judges a CAN interface: says what is wrong and which line cures it. Its numbers are those of
/// `ip -details -statistics link show`. Exit code 0: nothing is wrong, 1: something is, 2: there is no such
/// interface, or it is no CAN interface.
int run_can_check(const CanCheckOptions& options);

/// Something about an interface that its user should know.
struct CanFinding {
  bool problem = true;  ///< otherwise a note, which needs nothing done
  std::string what;
  std::string cure;  ///< lines for a shell, or what else to do; may be empty for a note
};

std::vector<CanFinding> can_findings(const CanInterface& interface, bool classic);

}  // namespace drivebench::command
