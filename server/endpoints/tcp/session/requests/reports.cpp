#include "server/endpoints/tcp/session/requests/reports.hpp"

#include <array>
#include <optional>
#include <string_view>

#include "plant/parameters/parameters.hpp"
#include "protocols/resident_memory.hpp"
#include "protocols/sample_codec.hpp"
#include "protocols/signals/catalogue.hpp"
#include "protocols/text.hpp"
#include "server/bench/change_requests.hpp"
#include "server/bench/terminals.hpp"
#include "server/recording/input_codec.hpp"

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

v1::ParameterDescription describe_parameter(const Engine& engine, std::size_t axis, std::size_t row) {
  const AxisParameters& p = engine.parameters(axis);
  const Parameter& parameter = axis_parameters(p)[row];
  v1::ParameterDescription d;
  d.set_name(std::string(parameter.name));
  d.set_unit(std::string(parameter.unit));
  d.set_minimum(parameter.minimum);
  d.set_maximum(parameter.maximum);
  d.set_integer(parameter.integer);
  d.set_live(parameter.live);
  d.set_value(parameter.get(p));
  d.set_meaning(std::string(parameter.meaning));
  for (const std::string_view word : parameter.words)
    d.add_words(std::string(word));
  return d;
}

v1::AxisDescription describe_axis(const Engine& engine, std::size_t axis) {
  const BenchConfig& config = engine.config();
  const AxisParameters& p = engine.parameters(axis);
  const Terminals terminals = terminals_of(p);
  v1::AxisDescription d;
  d.set_name(config.axes[axis].name);
  d.set_machine(config.axes[axis].motor);
  d.set_machine_kind(std::string(machine_kind(p)));
  d.set_phases(static_cast<std::uint32_t>(terminal_count(terminals.connection)));
  d.set_connection(std::string(word_of(terminals.connection)));
  d.set_field_winding(terminals.field);
  d.set_drive_kind(std::string(drive_word_of(p)));
  if (const auto partner = config.setup.axes[axis].shares_shaft_with) {
    d.set_shares_shaft_with(config.axes[*partner].name);
  }
  if (const auto other = config.setup.axes[axis].shares_amplifier_with) {
    d.set_shares_amplifier_with(config.axes[*other].name);
  }
  for (std::size_t row = 0; row < axis_parameters(p).size(); ++row)
    *d.add_parameters() = describe_parameter(engine, axis, row);
  return d;
}

}  // namespace

v1::BenchDescription describe(const Engine& engine) {
  const BenchConfig& config = engine.config();
  v1::BenchDescription d;
  d.set_name(config.name);
  d.set_mode(wire_mode(config.mode));
  d.set_period_s(static_cast<double>(config.setup.period_ns) * 1e-9);
  d.set_substeps(static_cast<std::uint32_t>(config.setup.substeps));
  d.set_command_delay_ticks(static_cast<std::uint32_t>(config.setup.command_delay_ticks));
  d.set_arming_commands(static_cast<std::uint32_t>(config.setup.arming_commands));
  d.set_watchdog_ticks(static_cast<std::uint32_t>(config.setup.watchdog_ticks));
  d.set_lease_s(static_cast<double>(config.setup.lease_ticks) * d.period_s());
  d.set_seed(config.setup.seed);
  d.set_configuration_hash(engine.configuration_hash());
  for (std::size_t axis = 0; axis < config.axes.size(); ++axis)
    *d.add_axes() = describe_axis(engine, axis);
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
  for (std::size_t row = 0; row < kInjectableFaultCount; ++row) {
    const InjectableFault& fault = kInjectableFaults[row];
    v1::InjectableFaultDescription& f = *d.add_injectable_faults();
    f.set_bit(std::uint64_t{1} << row);
    f.set_name(std::string(fault.name));
    f.set_unit(std::string(fault.unit));
    f.set_minimum(fault.magnitude ? -fault.maximum : 0.0);
    f.set_maximum(fault.maximum);
    f.set_integer(fault.integer);
    f.set_meaning(std::string(fault.meaning));
  }
  return d;
}

void report_parameters(Dialogue& dialogue, const v1::ReadParameters& r) {
  if (!dialogue.axis_exists(r.axis())) return;
  const Engine& engine = dialogue.engine();
  const std::span<const Parameter> table = axis_parameters(engine.parameters(r.axis()));
  if (static_cast<std::size_t>(r.names_size()) > table.size()) {
    return dialogue.refuse(dialogue.id(), v1::REFUSAL_OUT_OF_RANGE,
                           std::to_string(r.names_size()) + " names, but the axis has " +
                               std::to_string(table.size()) + " parameters",
                           "names");
  }
  v1::ParameterValues& values = *dialogue.begin_reply(dialogue.id()).mutable_parameter_values();
  for (const std::string& name : r.names()) {
    const Parameter* row = find_parameter(engine.parameters(r.axis()), name);
    if (row == nullptr) {
      return dialogue.refuse(dialogue.id(), v1::REFUSAL_UNKNOWN_PARAMETER,
                             unknown_parameter(engine.parameters(r.axis()), name), "names");
    }
    *values.add_parameters() =
        describe_parameter(engine, r.axis(), static_cast<std::size_t>(row - table.data()));
  }
  for (std::size_t row = 0; r.names().empty() && row < table.size(); ++row) {
    *values.add_parameters() = describe_parameter(engine, r.axis(), row);
  }
  dialogue.send_reply();
}

void report_status(Dialogue& dialogue) {
  const Engine& engine = dialogue.engine();
  const SessionContext& context = dialogue.context();
  v1::Status& status = *dialogue.begin_reply(dialogue.id()).mutable_status();
  status.set_mode(wire_mode(engine.config().mode));
  status.set_tick(static_cast<std::uint64_t>(engine.tick()));
  status.set_late_ticks(engine.newest(0).late_ticks);
  if (engine.config().mode == RunMode::kRealtime) {
    const SharedOctaveHistogram::View lateness = engine.lateness();
    status.set_worst_lateness_s(static_cast<double>(lateness.worst_ns) * 1e-9);
    status.mutable_lateness_counts()->Assign(lateness.buckets.begin(), lateness.buckets.end());
    status.set_lateness_sum_s(static_cast<double>(lateness.sum_ns) * 1e-9);
  }
  const OctaveHistogram& exchanges = context.exchange_times;
  status.mutable_exchange_counts()->Assign(exchanges.buckets().begin(), exchanges.buckets().end());
  status.set_exchange_sum_s(static_cast<double>(exchanges.sum_ns()) * 1e-9);
  status.set_resident_bytes(resident_bytes());
  status.set_sessions(static_cast<std::uint32_t>(context.session_count()));
  if (const Recorder* recorder = engine.recorder()) {
    status.set_recording(utf8(recorder->file()));
    status.set_recording_gaps(recorder->gaps());
    status.set_recording_over(recorder->is_over());
    if (const std::string remarks = recorder->remarks(); !remarks.empty())
      status.add_notes("recording: " + utf8(remarks));
  }
  for (std::uint32_t axis = 0; axis < dialogue.axis_count(); ++axis) {
    std::array<std::byte, kMaxSampleBytes> bytes;
    const std::size_t size = encode_sample(engine.present(axis), kAllSignals, bytes.data());
    v1::AxisSample& sample = *status.add_axes();
    sample.set_axis(axis);
    sample.mutable_sample()->ParseFromArray(bytes.data(), static_cast<int>(size));
  }
  status.set_state_hash(engine.state_hash());
  for (const std::string& note : engine.notes())
    status.add_notes(note);
  for (const TransportReport& report : context.transports()) {
    v1::TransportStatus& transport = *status.add_transports();
    transport.set_name(report.name);
    transport.set_state(report.state);
    for (const auto& [name, value] : report.counts) {
      v1::TransportStatus::Count& count = *transport.add_counts();
      count.set_name(std::string(name));
      count.set_value(value);
    }
  }
  dialogue.send_reply();
}

}  // namespace drivebench
