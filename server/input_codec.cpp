#include "server/input_codec.hpp"

#include <cmath>

#include "plant/parameters.hpp"

namespace drivebench {
namespace {

// Gates, lease actions and modes have the same numbers here and on the wire.
static_assert(static_cast<int>(Gates::kOff) == v1::GATES_OFF);
static_assert(static_cast<int>(Gates::kVoltage) == v1::GATES_VOLTAGE);
static_assert(static_cast<int>(Gates::kZeroVoltage) == v1::GATES_ZERO);
static_assert(static_cast<int>(LeaseAction::kAcquire) == v1::LeaseRequest::ACTION_ACQUIRE);
static_assert(static_cast<int>(LeaseAction::kLost) == v1::LeaseRequest::ACTION_LOST);

struct ActionWriter {
  v1::Input& message;

  void operator()(const Command& c) const {
    v1::Command& out = *message.mutable_command();
    out.set_tick(static_cast<std::uint64_t>(c.answers));
    out.set_gates(static_cast<v1::Gates>(c.phases.gates));
    out.set_u_a_v(c.phases.voltage_v.a);
    out.set_u_b_v(c.phases.voltage_v.b);
  }
  void operator()(const LeaseAction& action) const {
    message.set_lease(static_cast<v1::LeaseRequest::Action>(action));
  }
  void operator()(const LoadChange& change) const {
    message.mutable_load()->set_load_nm(change.load_nm);
    message.mutable_load()->set_ramp_ticks(static_cast<std::uint64_t>(change.ramp_ticks));
  }
  void operator()(const ParameterWrite& write) const {
    message.mutable_parameter()->set_name(std::string(axis_parameters()[write.row].name));
    message.mutable_parameter()->set_value(write.value);
  }
  void operator()(const ClearFaults&) const { message.set_clear(true); }
  void operator()(const LateTick&) const { message.set_late_tick(true); }
  void operator()(const Overrun&) const { message.set_overrun(true); }
  void operator()(const RefusedCommand&) const { message.set_refused_command(true); }
};

}  // namespace

void encode_input(Tick received, const Input& input, v1::Input& message) {
  message.Clear();
  message.set_tick(static_cast<std::uint64_t>(input.tick));
  message.set_received_tick(static_cast<std::uint64_t>(received));
  message.set_axis(input.axis);
  message.set_owner(input.owner);
  std::visit(ActionWriter{message}, input.action);
}

std::optional<Command> decode_command(const v1::Command& message) {
  if (!v1::Gates_IsValid(message.gates())) return std::nullopt;
  return Command{.answers = static_cast<Tick>(message.tick()),
                 .phases = {.gates = static_cast<Gates>(message.gates()),
                            .voltage_v = {message.u_a_v(), message.u_b_v()}}};
}

std::optional<Input> decode_input(const v1::Input& message) {
  Input input{.tick = static_cast<Tick>(message.tick()),
              .axis = message.axis(),
              .owner = message.owner(),
              .action = {}};
  switch (message.action_case()) {
    case v1::Input::kCommand: {
      const std::optional<Command> command = decode_command(message.command());
      if (!command) return std::nullopt;
      input.action = *command;
      return input;
    }
    case v1::Input::kLease:
      if (!v1::LeaseRequest::Action_IsValid(message.lease())) return std::nullopt;
      input.action = static_cast<LeaseAction>(message.lease());
      return input;
    case v1::Input::kLoad:
      if (!std::isfinite(message.load().load_nm())) return std::nullopt;
      input.action = LoadChange{message.load().load_nm(), static_cast<Tick>(message.load().ramp_ticks())};
      return input;
    case v1::Input::kParameter: {
      const Parameter* row = find_parameter(message.parameter().name());
      if (row == nullptr || !row->live || !problem_with(*row, message.parameter().value()).empty()) {
        return std::nullopt;
      }
      input.action = ParameterWrite{static_cast<std::uint32_t>(row - axis_parameters().data()),
                                    message.parameter().value()};
      return input;
    }
    case v1::Input::kClear:
      input.action = ClearFaults{};
      return input;
    case v1::Input::kLateTick:
      input.action = LateTick{};
      return input;
    case v1::Input::kOverrun:
      input.action = Overrun{};
      return input;
    case v1::Input::kRefusedCommand:
      input.action = RefusedCommand{};
      return input;
    case v1::Input::ACTION_NOT_SET:
      break;
  }
  return std::nullopt;
}

v1::Mode wire_mode(RunMode mode) noexcept {
  switch (mode) {
    case RunMode::kRealtime:
      return v1::MODE_REALTIME;
    case RunMode::kLockstep:
      return v1::MODE_LOCKSTEP;
    case RunMode::kFree:
      break;
  }
  return v1::MODE_FREE;
}

void encode_verdict(const Verdict& verdict, v1::Verdict& message) {
  message.set_mode(wire_mode(verdict.mode));
  message.set_ticks(verdict.ticks);
  message.set_exact(verdict.exact());
  message.set_realtime_valid(verdict.realtime_valid());
  message.set_late_ticks(verdict.late_ticks);
  message.set_worst_lateness_s(static_cast<double>(verdict.lateness.worst_ns()) * 1e-9);
  if (verdict.mode == RunMode::kRealtime) {
    for (const std::uint64_t count : verdict.lateness.buckets())
      message.add_lateness_counts(count);
  }
  message.set_gaps(verdict.gaps);
  message.set_state_hash(verdict.state_hash);
  message.set_sentence(verdict.sentence());
}

}  // namespace drivebench
