#include "plant/faults.hpp"
#include "plant/injected_faults.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/bench/terminals.hpp"
#include "server/inproc/inproc_bench.hpp"

namespace drivebench {
namespace {

void add_axis(abi::Description& d, const BenchConfig& bench, std::size_t axis, const AxisParameters& p) {
  const AxisConfig& config = bench.axes[axis];
  const std::optional<std::size_t> sharer = bench.setup.axes[axis].shares_amplifier_with;
  for (const Parameter& row : axis_parameters(p)) {
    d.add_parameter({.name = d.keep(row.name),
                     .unit = d.keep(row.unit),
                     .meaning = d.keep(row.meaning),
                     .minimum = row.minimum,
                     .maximum = row.maximum,
                     .value = row.get(p),
                     .integer = row.integer ? 1 : 0,
                     .live = row.live ? 1 : 0});
  }
  const Terminals terminals = terminals_of(p);
  d.add_axis({.name = d.keep(config.name),
              .machine = d.keep(config.motor),
              .machine_kind = d.keep(machine_kind(p)),
              .connection = d.keep(word_of(terminals.connection)),
              .drive_kind = d.keep(drive_word_of(p)),
              .phases = static_cast<std::uint32_t>(terminal_count(terminals.connection)),
              .field_winding = terminals.field ? 1 : 0,
              .parameter_count = 0,
              .parameters = nullptr,
              .shares_amplifier_with = d.keep(sharer ? bench.axes[*sharer].name : "")});
}

void add_faults(abi::Description& d) {
  for (const FaultInfo& fault : kFaultTable) {
    d.add_fault({.bit = fault.bit,
                 .name = d.keep(fault.name),
                 .meaning = d.keep(fault.meaning),
                 .latched = (fault.bit & kLatchedFaults) != 0 ? 1 : 0});
  }
  for (std::size_t row = 0; row < kInjectableFaultCount; ++row) {
    const InjectableFault& fault = kInjectableFaults[row];
    d.add_injectable({.bit = std::uint64_t{1} << row,
                      .name = d.keep(fault.name),
                      .unit = d.keep(fault.unit),
                      .meaning = d.keep(fault.meaning),
                      .minimum = fault.magnitude ? -fault.maximum : 0.0,
                      .maximum = fault.maximum,
                      .integer = fault.integer ? 1 : 0});
  }
}

}  // namespace

void InprocBench::describe_bench() {
  const BenchSetup& setup = config_.setup;
  drivebench_description& d = description_.bench;
  d.name = description_.keep(config_.name);
  d.mode = DRIVEBENCH_MODE_LOCKSTEP;
  d.period_s = static_cast<double>(setup.period_ns) * 1e-9;
  d.substeps = static_cast<std::uint32_t>(setup.substeps);
  d.command_delay_ticks = static_cast<std::uint32_t>(setup.command_delay_ticks);
  d.arming_commands = static_cast<std::uint32_t>(setup.arming_commands);
  d.watchdog_ticks = static_cast<std::uint32_t>(setup.watchdog_ticks);
  d.lease_s = static_cast<double>(setup.lease_ticks) * d.period_s;
  d.seed = setup.seed;
  d.configuration_hash = configuration_hash(config_);
  for (std::size_t axis = 0; axis < config_.axes.size(); ++axis)
    add_axis(description_, config_, axis, bench_.axis(axis).parameters());
  add_faults(description_);
  for (const EventState& event : event_states(config_, bench_)) {
    description_.add_event(
        {.axis = static_cast<std::uint32_t>(event.axis), .text = description_.keep(event.text)});
  }
  description_.finish(kAllSignals);
}

}  // namespace drivebench
