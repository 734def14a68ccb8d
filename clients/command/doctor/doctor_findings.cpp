// The rules of the doctor: facts of a machine in, findings out.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "clients/command/can/can_check.hpp"
#include "clients/command/doctor/doctor.hpp"

namespace drivebench::command {
namespace {

constexpr std::int64_t kHighResolution_ns = 1000;
constexpr double kMuchSteal = 0.001;  // of the time; a slice of it is milliseconds long

/// The line for a limit in /etc/security/limits.d, or of a service.
std::string limit_mend(std::string_view item, std::string_view value, std::string_view unit) {
  return fmt::format(
      "echo '* - {} {}' | sudo tee -a /etc/security/limits.d/drivebench.conf, then log in again; in a unit "
      "of systemd "
      "{}",
      item, value, unit);
}

HostFinding scheduling(const HostFacts& f) {
  constexpr const char* kWhy = "an ordinary thread waits for every other one";
  const bool permitted = f.may_schedule || f.realtime_priority.value_or(0) >= std::uint64_t{kTickPriority};
  if (permitted && f.wake_ups && !f.wake_ups->real_time)
    return {Health::kProblem, "SCHED_FIFO", "permitted by the limits, but the kernel refuses it", kWhy,
            "ask the container or the group of processes for it (cpu.rt_runtime_us, --cap-add SYS_NICE)"};
  if (permitted)
    return {Health::kFine, "SCHED_FIFO", fmt::format("priority {} is permitted", kTickPriority), kWhy};
  return {Health::kProblem, "SCHED_FIFO",
          fmt::format("priority {} is not permitted, the limit is {}", kTickPriority,
                      f.realtime_priority.value_or(0)),
          kWhy, limit_mend("rtprio", "98", "LimitRTPRIO=98")};
}

HostFinding memory(const HostFacts& f) {
  constexpr const char* kWhy = "memory that is not locked may have to come from the disk in a tick";
  if (f.may_lock || f.locked_bytes == std::numeric_limits<std::uint64_t>::max())
    return {Health::kFine, "memlock", "all memory may be locked", kWhy};
  return {Health::kProblem, "memlock",
          fmt::format("{} KiB may be locked, but the server locks all or nothing",
                      f.locked_bytes.value_or(0) / 1024),
          kWhy, limit_mend("memlock", "unlimited", "LimitMEMLOCK=infinity")};
}

HostFinding governor(const HostFacts& f) {
  constexpr const char* kWhy = "a CPU that slows down while it waits is slow when the tick comes";
  if (f.governors.empty())
    return {Health::kFine, "governor", "the clock of the CPUs is not scaled here, or not by this kernel",
            kWhy};
  const auto slow =
      std::ranges::find_if(f.governors, [](const std::string& g) { return g != "performance"; });
  if (slow == f.governors.end()) return {Health::kFine, "governor", "performance on every CPU", kWhy};
  const auto fast = std::ranges::count(f.governors, "performance");
  return {Health::kProblem, "governor",
          fmt::format("{} on {} of {} CPUs", *slow, static_cast<std::ptrdiff_t>(f.governors.size()) - fast,
                      f.governors.size()),
          kWhy, "sudo cpupower frequency-set -g performance"};
}

HostFinding isolation(const HostFacts& f) {
  constexpr const char* kWhy =
      "on a CPU of its own the tick meets no other task; name it as realtime.cpu of the bench";
  if (!f.isolated.empty()) return {Health::kFine, "isolated CPUs", f.isolated, kWhy};
  return {Health::kNote, "isolated CPUs", "none", kWhy,
          "isolcpus=3 nohz_full=3 rcu_nocbs=3 on the kernel's command line (GRUB_CMDLINE_LINUX), with a CPU "
          "of yours"};
}

HostFinding interrupts(const HostFacts& f) {
  constexpr const char* kWhy = "a tick on an isolated CPU waits for an interrupt that acts there";
  if (f.isolated.empty())
    return {Health::kFine, "interrupts", "no CPU is isolated that they could disturb", kWhy};
  if (f.interrupts_on_isolated.empty())
    return {Health::kFine, "interrupts", fmt::format("none acts on the isolated CPUs {}", f.isolated), kWhy};
  return {
      Health::kNote, "interrupts",
      fmt::format("{} on the isolated CPUs {}: {}", f.interrupts_on_isolated.size(), f.isolated,
                  fmt::join(f.interrupts_on_isolated, ", ")),
      kWhy,
      fmt::format("IRQBALANCE_BANNED_CPULIST={} in /etc/default/irqbalance, or for each: echo 0 | sudo tee "
                  "/proc/irq/{}/smp_affinity_list, with a CPU that is not isolated",
                  f.isolated, f.interrupts_on_isolated.front())};
}

HostFinding wall_clock(bool is_kept) {
  constexpr const char* kWhy =
      "recordings in real time, the audit log and the ends of tokens have its time; ticks do not";
  if (is_kept) return {Health::kFine, "wall clock", "kept by a time service", kWhy};
  return {Health::kNote, "wall clock", "no time service keeps it", kWhy, "sudo apt-get install chrony"};
}

HostFinding kernel(const HostFacts& f) {
  constexpr const char* kWhy = "without it the kernel's own work may delay a tick by a millisecond";
  if (f.preempt_rt) return {Health::kFine, "PREEMPT_RT", "this kernel has it", kWhy};
  return {Health::kNote, "PREEMPT_RT", "this kernel does not have it", kWhy,
          "sudo apt-get install linux-image-rt-amd64 (Debian), then start that kernel"};
}

HostFinding timer(const HostFacts& f) {
  constexpr const char* kWhy = "a tick begins when a timer of the kernel says so, and reads the clock";
  constexpr std::array<std::string_view, 3> kSlow = {"hpet", "acpi_pm", "jiffies"};
  if (f.resolution_ns.value_or(0) > kHighResolution_ns)
    return {Health::kProblem, "timer", fmt::format("resolution {} ns", *f.resolution_ns), kWhy,
            "take highres=off from the kernel's command line, or CONFIG_HIGH_RES_TIMERS into the kernel"};
  if (std::ranges::find(kSlow, f.clock_source) != kSlow.end())
    return {Health::kProblem, "timer",
            fmt::format("the clock is {}, which takes a microsecond to read", f.clock_source), kWhy,
            "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource"};
  return {Health::kFine, "timer",
          fmt::format("clock {}{}", f.clock_source.empty() ? "of the kernel's choice" : f.clock_source,
                      f.resolution_ns ? fmt::format(", resolution {} ns", *f.resolution_ns) : ""),
          kWhy};
}

HostFinding wake_ups(const WakeUps& w, double period_us) {
  const std::string what =
      fmt::format("{:.0f} us late at the median, {:.0f} in the worst of a hundred, {:.0f} at worst{}",
                  static_cast<double>(w.p50_ns) * 1e-3, static_cast<double>(w.p99_ns) * 1e-3,
                  static_cast<double>(w.worst_ns) * 1e-3, w.real_time ? "" : " (without SCHED_FIFO)");
  const std::string why =
      fmt::format("{} of {} wake-ups would have been a late tick of {:g} us", w.late, w.count, period_us);
  if (w.late == 0) return {Health::kFine, "wake-up", what, why};
  return {Health::kProblem, "wake-up", what, why,
          "mend what stands above, stop other programs, or give the bench a longer period_us; lockstep "
          "needs no real "
          "time"};
}

HostFinding steal(const HostFacts& f) {
  constexpr const char* kWhy =
      "what the host gives to other guests is missing in a tick, and nothing in the guest shows it";
  const double worst = std::max(f.steal, f.steal_now.value_or(0.0));
  const std::string what =
      fmt::format("a hypervisor took {:.2g} % of the time since the start{}", 100.0 * f.steal,
                  f.steal_now ? fmt::format(", {:.2g} % while this was measured", 100.0 * *f.steal_now) : "");
  if (worst <= kMuchSteal) return {Health::kFine, "steal", what, kWhy};
  return {Health::kProblem, "steal", what, kWhy,
          "on the host: CPUs of its own for this guest (virsh vcpupin), or a machine without a hypervisor"};
}

HostFinding can_modules(const HostFacts& f) {
  constexpr const char* kWhy =
      "the back end socketcan needs the kernel; udp_multicast, slcan over TCP and socketcand do not";
  if (f.has_can)
    return {
        Health::kFine, "kernel CAN",
        f.can_modules.empty() ? "in the kernel" : fmt::format("modules {}", fmt::join(f.can_modules, ", ")),
        kWhy};
  return {Health::kNote, "kernel CAN", "not loaded", kWhy, "sudo modprobe -a can can_raw vcan"};
}

}  // namespace

std::vector<HostFinding> realtime_findings(const HostFacts& facts, double period_us) {
  std::vector<HostFinding> found = {scheduling(facts), memory(facts), governor(facts), isolation(facts),
                                    interrupts(facts), kernel(facts), timer(facts),    steal(facts)};
  if (facts.is_wall_clock_kept) found.push_back(wall_clock(*facts.is_wall_clock_kept));
  if (facts.wake_ups) found.push_back(wake_ups(*facts.wake_ups, period_us));
  return found;
}

std::vector<HostFinding> can_host_findings(const HostFacts& facts, bool classic) {
  std::vector<HostFinding> found = {can_modules(facts)};
  if (facts.can_interfaces.empty())
    found.push_back({Health::kNote, "interfaces", "there is no CAN interface", "socketcan sends through one",
                     "connect an adapter and load its driver, or: " + make_virtual_can("vcan0")});
  for (const CanInterface& interface : facts.can_interfaces) {
    const std::string why = "drivebench can check " + interface.name + " knows the rules";
    const std::vector<CanFinding> all = can_findings(interface, classic);
    for (const CanFinding& each : all)
      found.push_back(
          {each.problem ? Health::kProblem : Health::kNote, interface.name, each.what, why, each.cure});
    if (std::ranges::none_of(all, &CanFinding::problem))
      found.push_back({Health::kFine, interface.name, can_summary(interface), why});
  }
  return found;
}

}  // namespace drivebench::command
