#include "clients/sdk/link_description.hpp"

namespace drivebench::sdk {
namespace {

void add_axis(abi::Description& d, const v1::AxisDescription& axis) {
  for (const v1::ParameterDescription& row : axis.parameters()) {
    d.add_parameter({.name = d.keep(row.name()),
                     .unit = d.keep(row.unit()),
                     .meaning = d.keep(row.meaning()),
                     .minimum = row.minimum(),
                     .maximum = row.maximum(),
                     .value = row.value(),
                     .integer = row.integer() ? 1 : 0,
                     .live = row.live() ? 1 : 0});
  }
  d.add_axis({.name = d.keep(axis.name()),
              .machine = d.keep(axis.machine()),
              .machine_kind = d.keep(axis.machine_kind()),
              .connection = d.keep(axis.connection()),
              .drive_kind = d.keep(axis.drive_kind()),
              .phases = axis.phases(),
              .field_winding = axis.field_winding() ? 1 : 0,
              .parameter_count = 0,
              .parameters = nullptr,
              .shares_amplifier_with = d.keep(axis.shares_amplifier_with())});
}

void add_faults(abi::Description& d, const v1::BenchDescription& bench) {
  for (const v1::FaultDescription& fault : bench.faults()) {
    d.add_fault({.bit = fault.bit(),
                 .name = d.keep(fault.name()),
                 .meaning = d.keep(fault.meaning()),
                 .latched = fault.latched() ? 1 : 0});
  }
  for (const v1::InjectableFaultDescription& fault : bench.injectable_faults()) {
    d.add_injectable({.bit = fault.bit(),
                      .name = d.keep(fault.name()),
                      .unit = d.keep(fault.unit()),
                      .meaning = d.keep(fault.meaning()),
                      .minimum = fault.minimum(),
                      .maximum = fault.maximum(),
                      .integer = fault.integer() ? 1 : 0});
  }
}

}  // namespace

std::unique_ptr<abi::Description> describe(const v1::BenchDescription& bench, SignalMask known) {
  auto description = std::make_unique<abi::Description>();
  drivebench_description& d = description->bench;
  d.name = description->keep(bench.name());
  d.mode = static_cast<std::int32_t>(bench.mode());
  d.period_s = bench.period_s();
  d.substeps = bench.substeps();
  d.command_delay_ticks = bench.command_delay_ticks();
  d.arming_commands = bench.arming_commands();
  d.watchdog_ticks = bench.watchdog_ticks();
  d.lease_s = bench.lease_s();
  d.seed = bench.seed();
  d.configuration_hash = bench.configuration_hash();
  for (const v1::AxisDescription& axis : bench.axes())
    add_axis(*description, axis);
  add_faults(*description, bench);
  description->finish(known);
  return description;
}

}  // namespace drivebench::sdk
