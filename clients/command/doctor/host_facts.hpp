#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/command/can/can_netlink.hpp"
#include "clients/command/doctor/wake_ups.hpp"

namespace drivebench::command {

/// What /proc and /sys tell of a machine, and what was measured on this one. A missing value: the kernel does
/// not say.
struct HostFacts {
  std::optional<std::uint64_t> realtime_priority{};  ///< RLIMIT_RTPRIO of this user
  std::optional<std::uint64_t> locked_bytes{};       ///< RLIMIT_MEMLOCK; the largest number: no limit
  bool may_schedule = false;                         ///< CAP_SYS_NICE
  bool may_lock = false;                             ///< root with CAP_IPC_LOCK
  bool preempt_rt = false;
  std::vector<std::string> governors{};               ///< of each CPU that has one
  std::string isolated{};                             ///< list of CPUs; empty: none
  std::vector<std::string> interrupts_on_isolated{};  ///< numbers of those that act on a CPU of that list
  std::string clock_source{};
  double steal = 0.0;  ///< part of the time that a hypervisor took, since the start of the machine

  std::optional<std::int64_t> resolution_ns{};  ///< of CLOCK_MONOTONIC
  std::optional<WakeUps> wake_ups{};
  std::optional<double> steal_now{};         ///< while the wake-ups were measured
  std::optional<bool> is_wall_clock_kept{};  ///< a program such as chrony disciplines it

  bool has_can = false;                    ///< the kernel speaks SocketCAN now
  std::vector<std::string> can_modules{};  ///< of can, can_raw, vcan: those that are loaded
  std::vector<CanInterface> can_interfaces{};
};

/// Reads the files below a root folder: `/`, or a copy of another machine's /proc and /sys.
HostFacts read_host(const std::filesystem::path& root);

/// Measures this machine for a time and adds it to the facts. A wake-up that is late by `period_ns` counts.
void measure_host(HostFacts& facts, double duration_s, std::int64_t period_ns);

}  // namespace drivebench::command
