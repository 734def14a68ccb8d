#pragma once

#include <string>
#include <vector>

#include "clients/link/can_netlink.hpp"

namespace drivebench::command {

struct CanCheckOptions {
  std::string interface;
  bool json = false;
  bool classic = false;  ///< classic frames will do: no FD is no problem
};

/// Says how a CAN interface is doing, what is wrong with it and how to put that right. Exit code 0: nothing
/// is wrong, 1: something is, 2: there is no such interface, or it has no CAN.
int run_can_check(const CanCheckOptions& options);

/// Something about an interface that its user should know.
struct CanFinding {
  bool problem = true;  ///< otherwise a note, which needs nothing done
  std::string what;
  std::string cure;  ///< lines for a shell, or what else to do; may be empty for a note
};

std::vector<CanFinding> can_findings(const link::CanInterface& interface, bool classic);

}  // namespace drivebench::command
