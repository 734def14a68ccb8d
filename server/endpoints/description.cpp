#include "server/endpoints/description.hpp"

#include "plant/parameters.hpp"
#include "protocols/catalogue.hpp"
#include "server/input_codec.hpp"

namespace drivebench {
namespace {

v1::SignalDescription::Kind wire_kind(SignalKind kind) noexcept {
  switch (kind) {
    case SignalKind::kStatus:
      return v1::SignalDescription::KIND_STATUS;
    case SignalKind::kSensor:
      return v1::SignalDescription::KIND_SENSOR;
    case SignalKind::kTruth:
      break;
  }
  return v1::SignalDescription::KIND_TRUTH;
}

}  // namespace

v1::ParameterDescription describe_parameter(const Engine& engine, std::size_t axis, std::size_t row) {
  const Parameter& parameter = axis_parameters()[row];
  v1::ParameterDescription d;
  d.set_name(std::string(parameter.name));
  d.set_unit(std::string(parameter.unit));
  d.set_minimum(parameter.minimum);
  d.set_maximum(parameter.maximum);
  d.set_integer(parameter.integer);
  d.set_live(parameter.live);
  d.set_value(parameter.get(engine.parameters(axis)));
  d.set_meaning(std::string(parameter.meaning));
  return d;
}

v1::BenchDescription describe(const Engine& engine) {
  const BenchConfig& config = engine.config();
  v1::BenchDescription d;
  d.set_name(config.name);
  d.set_mode(wire_mode(config.mode));
  d.set_period_s(static_cast<double>(config.setup.period_ns) * 1e-9);
  d.set_substeps(static_cast<std::uint32_t>(config.setup.substeps));
  d.set_command_delay_ticks(static_cast<std::uint32_t>(config.setup.command_delay_ticks));
  d.set_watchdog_ticks(static_cast<std::uint32_t>(config.setup.watchdog_ticks));
  d.set_lease_s(static_cast<double>(config.setup.lease_ticks) * d.period_s());
  d.set_seed(config.setup.seed);
  d.set_configuration_hash(configuration_hash(config));
  for (std::size_t axis = 0; axis < config.axes.size(); ++axis) {
    v1::AxisDescription& a = *d.add_axes();
    a.set_name(config.axes[axis].name);
    a.set_machine(config.axes[axis].motor);
    for (std::size_t row = 0; row < axis_parameters().size(); ++row) {
      *a.add_parameters() = describe_parameter(engine, axis, row);
    }
  }
  for (const Signal& signal : kSignals) {
    v1::SignalDescription& s = *d.add_signals();
    s.set_name(std::string(signal.name));
    s.set_unit(std::string(signal.unit));
    s.set_kind(wire_kind(signal.kind));
    s.set_minimum(signal.minimum);
    s.set_maximum(signal.maximum);
    s.set_meaning(std::string(signal.meaning));
  }
  for (const FaultInfo& fault : kFaultTable) {
    v1::FaultDescription& f = *d.add_faults();
    f.set_bit(fault.bit);
    f.set_name(std::string(fault.name));
    f.set_latched((fault.bit & kLatchedFaults) != 0);
    f.set_meaning(std::string(fault.meaning));
  }
  return d;
}

}  // namespace drivebench
