#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "clients/command/can/can_netlink.hpp"

namespace drivebench::command {

struct CanCheckOptions {
  std::string interface {};
  bool json = false;
  bool classic = false;  ///< classic frames are enough: missing FD is no problem
};

/// Checks a CAN interface and prints each problem with the line that cures it. The numbers are those of `ip
/// -details -statistics link show`. Exit code 0: no problems, 1: problems, 2: the interface does not exist or
/// is no CAN interface.
int run_can_check(const CanCheckOptions& options);

/// A problem of an interface, or a note about it.
struct CanFinding {
  bool problem = true;  ///< false: a note, which needs no action
  std::string what;
  std::string cure;  ///< shell lines or another action; may be empty for a note
};

/// The lines that make a virtual interface.
std::string make_virtual_can(std::string_view name);
/// State, bit rates and queue in some words.
std::string can_summary(const CanInterface& interface);

std::vector<CanFinding> can_findings(const CanInterface& interface, bool classic);

}  // namespace drivebench::command
