#include "clients/command/can/can_check.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/basics/json.hpp"
#include "protocols/json.hpp"

namespace drivebench::command {
namespace {

constexpr int kExitNoInterface = 2;
constexpr std::uint32_t kMtuFd = 72;
constexpr std::uint32_t kShortQueue = 100;  // the kernel's default for hardware is 10
constexpr std::string_view kAskTheWires =
    "all nodes need the same bit rates and about the same sample points, the bus 60 ohm between CAN_H and "
    "CAN_L, and a second node that acknowledges";

bool is_virtual(const CanInterface& interface) {
  return interface.kind == "vcan" || interface.kind == "vxcan";
}

/// `ip link set` lines for a change that the kernel allows only while the interface is down.
std::string while_down(const CanInterface& interface, std::string_view change) {
  return fmt::format("{0}ip link set {1} {2}; ip link set {1} up",
                     interface.up ? fmt::format("ip link set {} down; ", interface.name) : "", interface.name,
                     change);
}

/// Half of the bit after the sample point, the default of newer kernels.
std::uint32_t good_sjw(const CanBitTiming& timing) {
  const double after = timing.quanta * (1.0 - timing.sample_point);
  return static_cast<std::uint32_t>(std::clamp(after / 2.0 + 0.25, 1.0, 128.0));
}

std::string fd_timing(const CanBitTiming& slow, const CanBitTiming& fast) {
  return fmt::format(
      "type can bitrate {} sample-point {:.3f} sjw {} dbitrate {} dsample-point {:.3f} dsjw {} fd on",
      slow.bit_rate, slow.sample_point, good_sjw(slow), fast.bit_rate, fast.sample_point, good_sjw(fast));
}

void check_mtu(const CanInterface& interface, bool classic, std::vector<CanFinding>& found) {
  if (interface.mtu >= kMtuFd) return;
  const std::string what = "classic frames only, no CAN FD";
  if (is_virtual(interface)) {
    found.push_back({!classic, what, while_down(interface, "mtu 72")});
  } else {
    found.push_back(
        {!classic, what,
         while_down(interface,
                    "type can bitrate 1000000 sample-point 0.8 dbitrate 5000000 dsample-point 0.8 "
                    "fd on restart-ms 100") +
             ", if the controller has FD; else fd = false in the bench file"});
  }
}

void check_timing(const CanInterface& interface, const CanController& controller,
                  std::vector<CanFinding>& found) {
  if (!controller.fd || !controller.timing || !controller.data_timing) return;
  const CanBitTiming& slow = *controller.timing;
  const CanBitTiming& fast = *controller.data_timing;
  if ((slow.sjw < 2 && good_sjw(slow) >= 2) || (fast.sjw < 2 && good_sjw(fast) >= 2)) {
    found.push_back(
        {true,
         "a jump width (sjw) of 1 quantum, as kernels before 6.3 choose it: clocks that differ by "
         "0.1 % already break FD frames",
         while_down(interface, fd_timing(slow, fast))});
  }
  found.push_back({false,
                   fmt::format("sample points {:.3f} and {:.3f} of FD must be those of all other nodes",
                               slow.sample_point, fast.sample_point),
                   {}});
}

void check_controller(const CanInterface& interface, const CanController& controller,
                      std::vector<CanFinding>& found) {
  check_timing(interface, controller, found);
  if (controller.state == CanControllerState::kBusOff) {
    found.push_back({true, "bus-off: too many errors, the controller has left the bus",
                     fmt::format("ip link set {} type can restart; {}", interface.name, kAskTheWires)});
  } else if (controller.state == CanControllerState::kErrorPassive) {
    found.push_back({true, "error-passive: many errors on the bus", std::string(kAskTheWires)});
  } else if (controller.state == CanControllerState::kErrorWarning) {
    found.push_back({true, "error-warning: many errors on the bus", std::string(kAskTheWires)});
  }
  if (controller.restart_ms == 0) {
    found.push_back({true, "no restart-ms: after bus-off it stays off the bus",
                     while_down(interface, "type can restart-ms 100")});
  }
  if (controller.listen_only) {
    found.push_back(
        {true, "listen-only: nothing can be sent", while_down(interface, "type can listen-only off")});
  }
  if (controller.one_shot) {
    found.push_back({true, "one-shot: a frame that loses arbitration is lost",
                     while_down(interface, "type can one-shot off")});
  }
}

bool is_problem(const CanFinding& finding) {
  return finding.problem;
}

void print(const std::string& interface, const std::vector<CanFinding>& findings, bool json) {
  if (json) {
    Json list = Json::array();
    for (const CanFinding& finding : findings)
      list.push_back({{"problem", finding.problem}, {"what", finding.what}, {"cure", finding.cure}});
    const Json all = {{"interface", interface}, {"findings", list}};
    fmt::print("{}\n", json_text(all, 2));
    return;
  }
  for (const CanFinding& finding : findings) {
    fmt::print("{}: {}\n", finding.problem ? "problem" : "note", finding.what);
    if (!finding.cure.empty()) fmt::print("  cure: {}\n", finding.cure);
  }
  if (std::ranges::none_of(findings, is_problem)) fmt::print("no problems\n");
}

}  // namespace

std::string make_virtual_can(std::string_view name) {
  return fmt::format(
      "modprobe vcan; ip link add dev {0} type vcan; ip link set {0} mtu 72; ip link set {0} up", name);
}

std::string can_summary(const CanInterface& interface) {
  std::string text =
      fmt::format("{}, queue of {} frames, {}", interface.up ? "up" : "down", interface.queue_length,
                  interface.mtu >= kMtuFd ? "CAN FD" : "classic frames");
  if (!interface.controller) return text;
  for (const auto& timing : {interface.controller->timing, interface.controller->data_timing}) {
    if (timing) text += fmt::format(", {} bit/s", timing->bit_rate);
  }
  return text;
}

std::vector<CanFinding> can_findings(const CanInterface& interface, bool classic) {
  std::vector<CanFinding> found;
  const bool unset = interface.controller && !interface.controller->timing;
  if (!interface.up) {
    found.push_back(
        {true, "down",
         fmt::format(
             "ip link set {0} {1}up", interface.name,
             unset ? fmt::format("type can bitrate 1000000 restart-ms 100; ip link set {} ", interface.name)
                   : "")});
  }
  check_mtu(interface, classic, found);
  if (interface.queue_length < kShortQueue && !is_virtual(interface)) {
    found.push_back({true,
                     fmt::format("a queue of {} frames overflows at the first burst", interface.queue_length),
                     fmt::format("ip link set {} txqueuelen 1000", interface.name)});
  }
  if (interface.controller) check_controller(interface, *interface.controller, found);
  return found;
}

int run_can_check(const CanCheckOptions& options) {
  const std::string& name = options.interface;
  const std::optional<CanInterface> interface = read_can_interface(name);
  if (!interface) {
    print(name,
          {{true, fmt::format("there is no interface {}", name),
            "connect the adapter and load its driver; a virtual one: " + make_virtual_can(name)}},
          options.json);
    return kExitNoInterface;
  }
  if (!interface->is_can) {
    print(name,
          {{true, fmt::format("{} is no CAN interface", name),
            "those that are: grep -lx 280 /sys/class/net/*/type"}},
          options.json);
    return kExitNoInterface;
  }
  const std::vector<CanFinding> findings = can_findings(*interface, options.classic);
  print(name, findings, options.json);
  if (!options.json) fmt::print("its numbers: ip -details -statistics link show {}\n", name);
  return std::ranges::any_of(findings, is_problem) ? kExitFailed : kExitOk;
}

}  // namespace drivebench::command
