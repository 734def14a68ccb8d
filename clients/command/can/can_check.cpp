#include "clients/command/can/can_check.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "clients/command/common/errors.hpp"
#include "clients/command/common/json.hpp"

namespace drivebench::command {
namespace {

using link::CanBitTiming;
using link::CanController;
using link::CanControllerState;
using link::CanInterface;

constexpr int kExitCannotBeHad = 2;
constexpr std::uint32_t kMtuFd = 72;
constexpr std::uint32_t kShortQueue = 100;  // the kernel's default for hardware is 10
constexpr std::string_view kAskTheWires =
    "all nodes need the same bit rates and about the same sample points, the bus 60 ohm between CAN_H and "
    "CAN_L, and somebody besides us who acknowledges";

std::string_view name_of(CanControllerState state) {
  switch (state) {
    case CanControllerState::kErrorActive:
      return "error-active";
    case CanControllerState::kErrorWarning:
      return "error-warning";
    case CanControllerState::kErrorPassive:
      return "error-passive";
    case CanControllerState::kBusOff:
      return "bus-off";
    case CanControllerState::kStopped:
      return "stopped";
    case CanControllerState::kSleeping:
      return "sleeping";
  }
  return "unknown";
}

bool is_virtual(const CanInterface& interface) {
  return interface.kind == "vcan" || interface.kind == "vxcan";
}

/// `ip link set` lines that change what can be changed only while the interface is down.
std::string while_down(const CanInterface& interface, std::string_view change) {
  return fmt::format("{0}ip link set {1} {2}; ip link set {1} up",
                     interface.up ? fmt::format("ip link set {} down; ", interface.name) : "", interface.name,
                     change);
}

std::string make_virtual(std::string_view name) {
  return fmt::format(
      "modprobe vcan; ip link add dev {0} type vcan; ip link set {0} mtu 72; ip link set {0} up", name);
}

/// Half of what follows the sample point, which is what newer kernels choose by themselves.
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
  } else if (controller.state == CanControllerState::kErrorPassive ||
             controller.state == CanControllerState::kErrorWarning) {
    found.push_back({true, fmt::format("{}: many errors on the bus", name_of(controller.state)),
                     std::string(kAskTheWires)});
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

std::string timing_text(std::string_view what, const CanBitTiming& timing) {
  return fmt::format("  {}: {} bit/s, sample point {:.3f}, sjw {} of {} quanta of {:g} ns\n", what,
                     timing.bit_rate, timing.sample_point, timing.sjw, timing.quanta, timing.quantum_ns);
}

std::string as_text(const CanInterface& i) {
  std::string text =
      fmt::format("{}: {}, {}, {}, queue of {} frames\n", i.name, i.kind.empty() ? "CAN" : i.kind,
                  i.up ? "up" : "down", i.mtu >= kMtuFd ? "CAN FD" : "classic CAN", i.queue_length);
  if (i.controller) {
    const CanController& c = *i.controller;
    text += fmt::format("  {}, restart-ms {}", name_of(c.state), c.restart_ms);
    if (c.transmit_errors && c.receive_errors) {
      text += fmt::format(", error counters {} sent and {} received", *c.transmit_errors, *c.receive_errors);
    }
    text += '\n';
    if (c.timing) text += timing_text("bit timing", *c.timing);
    if (c.data_timing) text += timing_text("data phase", *c.data_timing);
    text += fmt::format("  {} times off the bus, {} bus errors, {} arbitrations lost\n", c.bus_offs,
                        c.bus_errors, c.arbitration_lost);
  }
  text += fmt::format("  received {} frames, {} errors, {} dropped; sent {} frames, {} errors, {} dropped\n",
                      i.receive_packets, i.receive_errors, i.receive_dropped, i.transmit_packets,
                      i.transmit_errors, i.transmit_dropped);
  return text;
}

Json timing_json(const std::optional<CanBitTiming>& timing) {
  if (!timing) return nullptr;
  return {{"bit_rate", timing->bit_rate},
          {"sample_point", timing->sample_point},
          {"sjw", timing->sjw},
          {"quanta", timing->quanta},
          {"quantum_ns", timing->quantum_ns}};
}

Json controller_json(const std::optional<CanController>& controller) {
  if (!controller) return nullptr;
  const auto counter = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
  return {{"state", name_of(controller->state)},
          {"fd", controller->fd},
          {"restart_ms", controller->restart_ms},
          {"transmit_errors", counter(controller->transmit_errors)},
          {"receive_errors", counter(controller->receive_errors)},
          {"bus_offs", controller->bus_offs},
          {"bus_errors", controller->bus_errors},
          {"arbitration_lost", controller->arbitration_lost},
          {"timing", timing_json(controller->timing)},
          {"data_timing", timing_json(controller->data_timing)}};
}

Json as_json(const CanInterface& i) {
  return {{"name", i.name},
          {"kind", i.kind},
          {"up", i.up},
          {"mtu", i.mtu},
          {"queue_length", i.queue_length},
          {"received",
           {{"frames", i.receive_packets}, {"errors", i.receive_errors}, {"dropped", i.receive_dropped}}},
          {"sent",
           {{"frames", i.transmit_packets}, {"errors", i.transmit_errors}, {"dropped", i.transmit_dropped}}},
          {"controller", controller_json(i.controller)}};
}

/// Prints what was found; the interface is null if it cannot be had.
void print(const CanInterface* interface, const std::vector<CanFinding>& findings, bool json) {
  if (json) {
    Json list = Json::array();
    for (const CanFinding& finding : findings)
      list.push_back({{"problem", finding.problem}, {"what", finding.what}, {"cure", finding.cure}});
    const Json all = {{"interface", interface == nullptr ? Json(nullptr) : as_json(*interface)},
                      {"findings", list}};
    fmt::print("{}\n", all.dump(2, ' ', false, Json::error_handler_t::replace));
    return;
  }
  if (interface != nullptr) fmt::print("{}", as_text(*interface));
  for (const CanFinding& finding : findings) {
    fmt::print("{}: {}\n", finding.problem ? "problem" : "note", finding.what);
    if (!finding.cure.empty()) fmt::print("  cure: {}\n", finding.cure);
  }
  if (std::none_of(findings.begin(), findings.end(), [](const auto& each) { return each.problem; })) {
    fmt::print("no problems\n");
  }
}

}  // namespace

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
  if (interface.receive_dropped + interface.transmit_dropped > 0) {
    found.push_back({false,
                     fmt::format("{} frames received and {} to be sent were dropped since it was made",
                                 interface.receive_dropped, interface.transmit_dropped),
                     {}});
  }
  return found;
}

int run_can_check(const CanCheckOptions& options) {
  const std::optional<CanInterface> interface = link::read_can_interface(options.interface);
  if (!interface) {
    print(nullptr,
          {{true, fmt::format("there is no interface {}", options.interface),
            "connect the adapter and load its driver; a virtual one: " + make_virtual(options.interface)}},
          options.json);
    return kExitCannotBeHad;
  }
  if (!interface->is_can) {
    print(nullptr,
          {{true, fmt::format("{} is no CAN interface", options.interface),
            "those that are: grep -lx 280 /sys/class/net/*/type"}},
          options.json);
    return kExitCannotBeHad;
  }
  const std::vector<CanFinding> findings = can_findings(*interface, options.classic);
  print(&*interface, findings, options.json);
  return std::any_of(findings.begin(), findings.end(), [](const auto& each) { return each.problem; })
             ? kExitFailed
             : kExitOk;
}

}  // namespace drivebench::command
