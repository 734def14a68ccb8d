#include "server/interface_text.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <span>
#include <stdexcept>
#include <vector>

#include "plant/faults.hpp"
#include "plant/injected_faults.hpp"
#include "protocols/can/dbc.hpp"
#include "protocols/can/table_text.hpp"
#include "server/bench/terminals.hpp"
#include "server/endpoints/modbus/map_info.hpp"

namespace drivebench {
namespace {

std::vector<can::BusAxis> bus_axes(const BenchConfig& config) {
  std::vector<can::BusAxis> axes;
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    axes.push_back({.name = config.axes[i].name,
                    .node = config.axes[i].can_node,
                    .wide = terminals_of(config.setup.axes[i].parameters).is_wide()});
  }
  return axes;
}

/// The names of the bits in the signals `faults` and `injected`.
std::vector<can::BitWord> fault_words() {
  std::vector<can::BitWord> words{{.signal = "faults", .bits = {}}, {.signal = "injected", .bits = {}}};
  for (const FaultInfo& fault : kFaultTable)
    words[0].bits.push_back({static_cast<unsigned>(fault.bit), fault.name});
  for (std::size_t row = 0; row < kInjectableFaultCount; ++row)
    words[1].bits.push_back({1U << row, kInjectableFaults[row].name});
  return words;
}

/// Whether the bench has a wide axis, whose frames need more identifiers.
bool has_wide_axis(const BenchConfig& config) {
  return std::any_of(config.setup.axes.begin(), config.setup.axes.end(),
                     [](const AxisSetup& axis) { return terminals_of(axis.parameters).is_wide(); });
}

CanConfig chosen_bus(const BenchConfig& config, std::size_t bus) {
  if (config.can.empty() ? bus != 1 : bus < 1 || bus > config.can.size()) {
    throw std::runtime_error(
        fmt::format("--bus {}: bench {} has {} [[can]] sections", bus, config.name, config.can.size()));
  }
  CanConfig chosen = config.can.empty() ? CanConfig{} : config.can[bus - 1];
  chosen.profile.wide = has_wide_axis(config);
  return chosen;
}

/// The share of a limit that the frames of a bus take in real time.
struct Need {
  double share = 0.0;
  std::string limit;
};

/// Frames that the bench sends.
double frames_per_s(const can::BusLoad& load) {
  double sum = 0.0;
  for (const can::MessageLoad& message : load.messages) {
    if (message.row->sender == can::Sender::kBench) sum += message.frames_per_s;
  }
  return sum;
}

Need need_of(const BenchConfig& config, const CanConfig& bus) {
  const can::BusLoad load = bus_load_of(config, bus);
  const double limit = can::row_of(bus.backend).frames_per_s;
  const double datagram_share = limit > 0.0 ? frames_per_s(load) / limit : 0.0;
  if (datagram_share > load.most_share) {
    return {datagram_share, fmt::format("the {:.0f} datagrams/s that receivers take", limit)};
  }
  return {load.most_share, fmt::format("what {} bit/s allow", bus.bit_rate)};
}

/// The smallest sample_every_ticks with which the bus carries its frames; 0 if no value is enough.
std::int64_t enough_ticks(const BenchConfig& config, CanConfig bus) {
  const auto fits = [&](std::int64_t ticks) {
    bus.sample_every_ticks = ticks;
    return need_of(config, bus).share <= 1.0;
  };
  std::int64_t too_few = bus.sample_every_ticks;
  std::int64_t enough = too_few + 10'000;
  if (!fits(enough)) return 0;
  while (enough - too_few > 1) {
    const std::int64_t middle = too_few + (enough - too_few) / 2;
    (fits(middle) ? enough : too_few) = middle;
  }
  return enough;
}

}  // namespace

can::BusLoad bus_load_of(const BenchConfig& config, const CanConfig& bus) {
  can::Profile profile = bus.profile;
  profile.wide = has_wide_axis(config);
  const auto count = [&config](auto has) {
    return static_cast<std::size_t>(
        std::count_if(config.setup.axes.begin(), config.setup.axes.end(),
                      [&](const AxisSetup& axis) { return has(terminals_of(axis.parameters)); }));
  };
  return can::bus_load(profile, {.axes = config.axes.size(),
                                 .wide_axes = count([](const Terminals& t) { return t.is_wide(); }),
                                 .sensing_axes = count([](const Terminals& t) { return t.speed_sensors; }),
                                 .period_s = static_cast<double>(config.setup.period_ns) * 1e-9,
                                 .sample_every_ticks = static_cast<double>(bus.sample_every_ticks),
                                 .state_every_ticks = static_cast<double>(bus.state_every_ticks),
                                 .heartbeat_ms = static_cast<double>(bus.heartbeat_ms),
                                 .edges = bus.edges,
                                 .bit_rate = static_cast<double>(bus.bit_rate),
                                 .data_bit_rate = static_cast<double>(bus.data_bit_rate)});
}

std::vector<std::string> bus_overloads(const BenchConfig& config) {
  std::vector<std::string> overloads;
  for (std::size_t i = 0; i < config.can.size(); ++i) {
    const CanConfig& bus = config.can[i];
    const Need need = need_of(config, bus);
    if (need.share <= 1.0) continue;
    const std::int64_t enough = enough_ticks(config, bus);
    const std::string cure = enough != 0 ? fmt::format("raise sample_every_ticks from {} to {}, or period_us",
                                                       bus.sample_every_ticks, enough)
                                         : fmt::format("raise period_us or state_every_ticks{}",
                                                       bus.edges ? ", or leave edges out" : "");
    overloads.push_back(
        fmt::format("bus {} must carry {:.0f} % of {}: {}", i + 1, 100.0 * need.share, need.limit, cure));
  }
  return overloads;
}

std::string interface_text(const BenchConfig& config, std::string_view what, std::size_t bus) {
  if (what.starts_with("modbus")) return modbus::map_of(config, what == "modbus-csv");
  const CanConfig chosen = chosen_bus(config, bus);
  const std::vector<can::BitWord> words = fault_words();
  const can::BusLoad load = bus_load_of(config, chosen);
  if (what == "dbc") {
    const bool has_period =
        config.mode != RunMode::kLockstep;  // a tick of lockstep takes as long as its command
    return can::dbc_text(config.name, chosen.profile, bus_axes(config),
                         has_period ? std::span(load.messages) : std::span<const can::MessageLoad>(), words);
  }
  return can::table_text(config.name, chosen.profile, bus_axes(config), words) +
         "\n## Load in real time\n\n" + can::load_text(load);
}

}  // namespace drivebench
