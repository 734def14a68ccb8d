#include "clients/command/common/session/inproc_axis.hpp"

#include <bit>
#include <span>

#include "clients/command/common/basics/errors.hpp"
#include "clients/command/common/session/session.hpp"
#include "clients/link/tcp/tcp_axis.hpp"

namespace drivebench::command {
namespace {

void describe_axis(const drivebench_axis& from, v1::AxisDescription& to) {
  to.set_name(from.name);
  to.set_machine(from.machine);
  to.set_machine_kind(from.machine_kind);
  to.set_connection(from.connection);
  to.set_drive_kind(from.drive_kind);
  to.set_phases(from.phases);
  to.set_field_winding(from.field_winding != 0);
  to.set_shares_amplifier_with(from.shares_amplifier_with);
  for (const drivebench_parameter& row : std::span(from.parameters, from.parameter_count)) {
    v1::ParameterDescription& parameter = *to.add_parameters();
    parameter.set_name(row.name);
    parameter.set_unit(row.unit);
    parameter.set_meaning(row.meaning);
    parameter.set_minimum(row.minimum);
    parameter.set_maximum(row.maximum);
    parameter.set_value(row.value);
    parameter.set_integer(row.integer != 0);
    parameter.set_live(row.live != 0);
  }
}

v1::BenchDescription description_of(const client::Description& from) {
  v1::BenchDescription to;
  to.set_name(from.name);
  to.set_mode(static_cast<v1::Mode>(from.mode));
  to.set_period_s(from.period_s);
  to.set_substeps(from.substeps);
  to.set_command_delay_ticks(from.command_delay_ticks);
  to.set_arming_commands(from.arming_commands);
  to.set_watchdog_ticks(from.watchdog_ticks);
  to.set_lease_s(from.lease_s);
  to.set_seed(from.seed);
  to.set_configuration_hash(from.configuration_hash);
  for (const drivebench_axis& axis : std::span(from.axes, from.axis_count))
    describe_axis(axis, *to.add_axes());
  for (const drivebench_fault& row : std::span(from.faults, from.fault_count)) {
    v1::FaultDescription& fault = *to.add_faults();
    fault.set_bit(row.bit);
    fault.set_name(row.name);
    fault.set_meaning(row.meaning);
    fault.set_latched(row.latched != 0);
  }
  return to;
}

client::Bench open_bench(const std::string& bench) {
  try {
    return client::Bench("inproc:" + bench);
  } catch (const client::Error& error) {
    throw UsageError(error.what());
  }
}

}  // namespace

InprocAxis::InprocAxis(const std::string& bench, std::string_view axis)
    : bench_(open_bench(bench)),
      description_(description_of(bench_.describe())),
      axis_(axis_number(description_, axis)),
      second_axis_(link::sharer_of_amplifier(description_, axis_)),
      samples_(static_cast<std::size_t>(description_.axes_size())) {}

/// Turns the errors of the ABI into those of a link.
template <class Request>
void InprocAxis::request(Request what) {
  try {
    what();
  } catch (const client::Error& error) {
    if (error.code() < 0) throw link::LinkError(error.what());
    link::refuse(static_cast<v1::RefusalCode>(error.code()), error.what(), error.field());
  }
}

void InprocAxis::acquire() {
  request([this] { bench_.acquire(axis_); });
}

void InprocAxis::release() {
  request([this] { bench_.release(axis_); });
}

void InprocAxis::clear_faults() {
  request([this] { bench_.clear(axis_); });
}

const Sample& InprocAxis::newest() {
  request([this] { samples_[axis_] = std::bit_cast<Sample>(bench_.newest(axis_)); });
  read_second();
  return samples_[axis_];
}

const Sample& InprocAxis::exchange(const link::AxisCommand& command) {
  const link::Setpoints x = link::setpoints_of(command);
  const client::Command ours{.axis = axis_,
                             .gates = static_cast<std::uint32_t>(command.gates),
                             .tick = command.tick,
                             .setpoint_a = x.a,
                             .setpoint_b = x.b,
                             .setpoint_c = x.c,
                             .setpoint_f = x.f,
                             .legs_off = command.legs_off,
                             .edges = {}};
  request([&] { bench_.step(ours, answer_); });
  samples_[axis_] = std::bit_cast<Sample>(answer_);
  read_second();
  return samples_[axis_];
}

void InprocAxis::read_second() {
  if (!second_axis_) return;
  request([this] { samples_[*second_axis_] = std::bit_cast<Sample>(bench_.newest(*second_axis_)); });
}

void InprocAxis::write_parameter(std::string_view name, double value) {
  request([&] { bench_.set(std::string(name), value, axis_); });
}

void InprocAxis::set_load(const link::LoadChange& change) {
  request([&] {
    bench_.set_load(change.load_nm, axis_, {.ramp_ticks = change.ramp_ticks, .at_tick = change.at_tick});
  });
}

const std::vector<Sample>& InprocAxis::all() {
  for (std::uint32_t axis = 0; axis < samples_.size(); ++axis) {
    if (axis != axis_) samples_[axis] = std::bit_cast<Sample>(bench_.newest(axis));
  }
  return samples_;
}

}  // namespace drivebench::command
