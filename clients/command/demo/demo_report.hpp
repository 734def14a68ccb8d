#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "clients/command/control/control_run.hpp"

namespace drivebench::command {

/// The last line of drivebench-server.
struct ServerVerdict {
  std::uint64_t ticks = 0;
  std::uint64_t late_ticks = 0;
  double worst_lateness_us = 0.0;
  bool exact = false;
  bool realtime_valid = false;
  std::string state_hash;
  std::string recording;
  std::string sentence;
};

/// One of the two halves of the demo.
struct DemoRun {
  ControlReport control;
  ServerVerdict verdict;
  std::string recording;
  std::string failure;  ///< empty: none
  int attempts = 1;
};

/// The result of replaying the lockstep recording.
struct DemoReplay {
  bool equal = false;
  std::uint64_t ticks = 0;
  std::uint64_t samples = 0;
  std::string state_hash;
  std::string problem;  ///< empty: none
};

struct DemoReport {
  DemoRun lockstep;
  DemoRun realtime;
  DemoReplay replay;
};

}  // namespace drivebench::command
