#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/command/doctor/host_facts.hpp"

namespace drivebench::command {

struct DoctorOptions {
  bool json = false;
  std::string root = "/";
  double measure_s = 1.0;
  double period_us = 125.0;
  bool classic = false;
};

/// Prints what hinders real time and CAN on this machine, and the commands that mend it. Exit code 0: no
/// problems, 1: problems.
int run_doctor(const DoctorOptions& options);

enum class Health : std::uint8_t { kFine, kNote, kProblem };

/// One line of the doctor.
struct HostFinding {
  Health health;
  std::string name;
  std::string what;
  std::string why;
  std::string mend{};  ///< empty where nothing needs to be mended
};

/// The judgement on the facts. A wake-up that is late by `period_us` would have been a late tick.
std::vector<HostFinding> realtime_findings(const HostFacts& facts, double period_us);
std::vector<HostFinding> can_host_findings(const HostFacts& facts, bool classic);

}  // namespace drivebench::command
