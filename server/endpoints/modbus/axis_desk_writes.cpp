// Carries out the writes to the registers and coils of an axis.
#include <cmath>
#include <vector>

#include "server/endpoints/modbus/axis_desk.hpp"

namespace drivebench::modbus {
namespace {

constexpr double kReferenceUnit = 0.01;  // of the process data [V] or [A]

/// The tick nearest to `newest` with these low bits.
Tick tick_of(std::uint32_t counter, Tick newest) noexcept {
  return newest + static_cast<std::int32_t>(counter - static_cast<std::uint32_t>(newest));
}

Gates gates_of(CommandMode mode) noexcept {
  switch (mode) {
    case CommandMode::kVoltage:
      return Gates::kVoltage;
    case CommandMode::kZeroVoltage:
      return Gates::kZeroVoltage;
    case CommandMode::kDuty:
    case CommandMode::kLegDuty:
      return Gates::kDuty;
    case CommandMode::kCurrent:
      return Gates::kCurrent;
    case CommandMode::kOff:
      break;
  }
  return Gates::kOff;
}

float as_float(std::uint64_t bits) noexcept {
  return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
}

}  // namespace

std::optional<std::uint64_t> AxisDesk::Written::operator[](Content content) const noexcept {
  for (const Row& row : range.rows) {
    if (row.content == content)
      return get(row.type, range.order, &words[std::size_t{row.address} - range.first]);
  }
  return std::nullopt;
}

AxisDesk::Outcome AxisDesk::refuse(Refused why) noexcept {
  return {.exception = refusal_row(why).exception, .refused = why};
}

Refused AxisDesk::no_lease() const {
  return engine_.takes_voltages(axis_) ? Refused::kSharedAmplifier : Refused::kNotOwner;
}

void AxisDesk::note_refusal(Visitor visitor, Refused why) noexcept {
  last_refusal_ = why;
  if (holds(visitor)) holders_refusal_ = why;
}

void AxisDesk::count_refused(const RegisterMap::Range& range, std::span<const std::uint16_t> words,
                             Visitor visitor) {
  const Written written{range, words};
  if (!written[Content::kCounter] && range.first >= kCommandStart) return;  // process data always command
  const auto key = written[Content::kLeaseKey];
  const bool is_owner =
      holds(visitor) || (key && seat_.is_held() && opens(static_cast<std::uint16_t>(*key), visitor));
  if (!is_owner) return;
  engine_.request({.tick = 0, .axis = axis_, .owner = seat_.owner(), .action = RefusedCommand{true}},
                  [](Refused, Tick) {});
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::write(RegisterMap::Range range,
                                                   std::span<const std::uint16_t> words, Visitor visitor) {
  const Written written{range, words};
  if (range.first >= kParameterStart) return write_parameters(written, visitor);
  return range.first >= kCommandStart ? write_command(written, visitor) : write_process(written, visitor);
}

/// Gives a command to the bench, which counts it if it refuses it.
AxisDesk::Outcome AxisDesk::command(const Command& command) {
  const Refused why = engine_.command(axis_, seat_.owner(), command);
  if (why != Refused::kNot) return refuse(why);
  engine_.advance();
  return {.commanded = true};
}

Command AxisDesk::command_of(const ProcessInput& input, DriveState state) const {
  Command command = gates_off();
  if (state == DriveState::kQuickStopActive) command.phases.gates = Gates::kZeroVoltage;
  if (state != DriveState::kOperationEnabled) return command;
  const bool currents = input.mode == ReferenceMode::kCurrent;
  command.phases = {.gates = currents ? Gates::kCurrent : Gates::kVoltage,
                    .setpoint = {.a = input.a * kReferenceUnit,
                                 .b = input.b * kReferenceUnit,
                                 .c = input.c * kReferenceUnit,
                                 .field = input.field * kReferenceUnit}};
  return command;
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::write_process(Written written, Visitor visitor) {
  ProcessInput input = process_;
  if (const auto word = written[Content::kControlWord])
    input.control_word = static_cast<std::uint16_t>(*word);
  if (const auto mode = written[Content::kReferenceMode]) input.mode = static_cast<ReferenceMode>(*mode);
  if (const auto bits = written[Content::kReferenceA]) input.a = static_cast<std::int16_t>(*bits);
  if (const auto bits = written[Content::kReferenceB]) input.b = static_cast<std::int16_t>(*bits);
  if (const auto bits = written[Content::kReferenceC]) input.c = static_cast<std::int16_t>(*bits);
  if (const auto bits = written[Content::kReferenceField]) input.field = static_cast<std::int16_t>(*bits);
  // Checked first, so that a write that the bench refuses clears no fault.
  const Owner owner = holds(visitor) ? seat_.owner() : 0;
  if (const Refused why = engine_.check(axis_, owner, gates_off()); why != Refused::kNot) {
    engine_.command(axis_, owner, gates_off());  // so that it is counted
    Outcome outcome = refuse(why);
    // Process data name no tick: if this tick already has its command, the client must try again.
    if (why == Refused::kStale) outcome.exception = Exception::kBusy;
    co_return outcome;
  }
  const DriveState before = drive_state();
  DriveState state = next_state(before, input.control_word);
  const bool resets = (input.control_word & ~process_.control_word & kFaultReset) != 0;
  if (before == DriveState::kFault && resets) {
    const Input clear{.tick = 0, .axis = axis_, .owner = seat_.owner(), .action = ClearFaults{}};
    const Refused why = co_await ask(clear);
    if (why != Refused::kNot) co_return refuse(why);
    if (!holds(visitor)) co_return refuse(Refused::kNotOwner);  // the lease ended during the wait
    state = DriveState::kSwitchOnDisabled;
  }
  const Command wanted = command_of(input, state);
  if (engine_.check(axis_, seat_.owner(), wanted) == Refused::kNot) {
    process_ = input;
    state_ = state == DriveState::kFault ? DriveState::kSwitchOnDisabled : state;
  }
  co_return command(wanted);
}

Command AxisDesk::command_of(const CommandInput& input) const {
  Command command{.answers = tick_of(input.counter, engine_.tick()), .phases = {}};
  command.phases.gates = gates_of(input.mode);
  command.phases.legs_off = input.legs_off;
  if (input.mode == CommandMode::kOff || input.mode == CommandMode::kZeroVoltage) return command;
  const PhaseValues setpoint{.a = static_cast<double>(input.a),
                             .b = static_cast<double>(input.b),
                             .c = static_cast<double>(input.c),
                             .field = static_cast<double>(input.field)};
  command.phases.setpoint =
      input.mode == CommandMode::kDuty ? terminals_.duties_from_middle(setpoint) : setpoint;
  return command;
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::write_command(Written written, Visitor visitor) {
  const auto key = written[Content::kLeaseKey];
  const auto request = static_cast<AxisRequest>(written[Content::kRequest].value_or(0));
  const bool commands = written[Content::kCounter].has_value();
  const bool gives_back = key == 0u || request == AxisRequest::kRelease;
  CommandInput input = command_;
  if (const auto mode = written[Content::kCommandMode]) input.mode = static_cast<CommandMode>(*mode);
  if (const auto counter = written[Content::kCounter]) input.counter = static_cast<std::uint32_t>(*counter);
  if (const auto bits = written[Content::kSetpointA]) input.a = as_float(*bits);
  if (const auto bits = written[Content::kSetpointB]) input.b = as_float(*bits);
  if (const auto bits = written[Content::kSetpointC]) input.c = as_float(*bits);
  if (const auto bits = written[Content::kSetpointField]) input.field = as_float(*bits);
  if (const auto bits = written[Content::kLegsOff]) input.legs_off = static_cast<std::uint16_t>(*bits);
  const auto is_beyond = [](float duty) { return std::abs(duty) > 1.0f; };
  const bool beyond =
      is_beyond(input.a) || is_beyond(input.b) || is_beyond(input.c) || is_beyond(input.field);
  const bool asks_more = request != AxisRequest::kNone && request != AxisRequest::kRelease;
  if ((input.mode == CommandMode::kDuty && beyond) || (key == 0u && asks_more) ||
      (commands && (gives_back || request == AxisRequest::kClearFaults))) {
    count_refused(written.range, written.words, visitor);
    co_return refuse(Refused::kOutOfRange);
  }

  const bool had_lease = seat_.is_held();
  if (key.value_or(0) != 0) {
    if (engine_.config().mode == RunMode::kFree) {
      co_return refuse(Refused::kWrongMode);
    }
    const bool is_open = !had_lease || opens(static_cast<std::uint16_t>(*key), visitor);
    // All or nothing: a refused command leaves the lease with its connection.
    if (commands && had_lease && is_open &&
        engine_.check(axis_, seat_.owner(), command_of(input)) != Refused::kNot) {
      co_return refuse(engine_.command(axis_, seat_.owner(), command_of(input)));  // so that it is counted
    }
    Refused why = Refused::kOwned;
    if (is_open) why = co_await take_lease(static_cast<std::uint16_t>(*key), !commands, visitor);
    if (why != Refused::kNot) co_return refuse(why);
  }
  if (!commands) {
    if (!holds(visitor)) co_return refuse(no_lease());
    command_ = input;
    const AxisRequest wanted = gives_back ? AxisRequest::kRelease : request;
    co_return co_await carry_out(wanted, visitor);
  }
  const Owner owner = holds(visitor) ? seat_.owner() : 0;
  if (engine_.check(axis_, owner, command_of(input)) == Refused::kNot) {
    command_ = input;
    co_return command(command_of(input));
  }
  const Refused why = engine_.command(axis_, owner, command_of(input));
  if (!had_lease && holds(visitor)) {  // this command brought the lease
    forget_holder();
    seat_.give_back();
  }
  co_return refuse(why);
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::carry_out(AxisRequest request, Visitor visitor) {
  if (!holds(visitor)) co_return refuse(no_lease());
  if (request == AxisRequest::kNone) co_return Outcome{};
  const Owner owner = seat_.owner();
  Refused why = Refused::kNot;
  if (request == AxisRequest::kRelease) {
    why = co_await ask(LeaseAction::kRelease, owner);
  } else if (request == AxisRequest::kRenew) {
    why = co_await ask(LeaseAction::kRenew, owner);
  } else {
    why = co_await ask({.tick = 0, .axis = axis_, .owner = owner, .action = ClearFaults{}});
  }
  if (why != Refused::kNot) co_return refuse(why);
  if (request == AxisRequest::kRelease && seat_.owner() == 0) forget_holder();
  if (request == AxisRequest::kClearFaults) state_ = DriveState::kSwitchOnDisabled;
  co_return Outcome{};
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::write_coils(std::size_t address, std::size_t count,
                                                         std::uint8_t bits, Visitor visitor) {
  Outcome outcome;
  for (std::size_t i = 0; i < count && outcome.exception == Exception::kNone; ++i) {
    const bool on = (bits >> i & 1) != 0;
    const bool is_lease = address + i == static_cast<std::size_t>(Coil::kLease);
    const AxisRequest request = is_lease ? (on ? AxisRequest::kRenew : AxisRequest::kRelease)
                                : on     ? AxisRequest::kClearFaults
                                         : AxisRequest::kNone;
    outcome = co_await carry_out(request, visitor);
  }
  co_return outcome;
}

asio::awaitable<AxisDesk::Outcome> AxisDesk::write_parameters(Written written, Visitor visitor) {
  if (!holds(visitor) && engine_.config().mode != RunMode::kFree) co_return refuse(no_lease());
  struct Change {
    std::uint32_t row;
    double before;
    double after;
  };
  std::vector<Change> changes;
  for (const Row& row : written.range.rows) {
    const std::uint64_t bits =
        get(row.type, written.range.order, &written.words[std::size_t{row.address} - written.range.first]);
    changes.push_back({.row = parameter_rows_[row.index],
                       .before = parameter(row).get(engine_.parameters(axis_)),
                       .after = number_of(row.type, bits)});
  }
  for (std::size_t i = 0; i < changes.size(); ++i) {
    if (engine_.try_parameter(axis_, changes[i].row, changes[i].after).empty()) continue;
    while (i-- > 0)  // undoes them in reverse order
      engine_.try_parameter(axis_, changes[i].row, changes[i].before);
    co_return refuse(Refused::kOutOfRange);
  }
  // Sends all before it waits for an answer: the bench takes them together, in one tick.
  const Owner owner = holds(visitor) ? seat_.owner() : 0;
  std::vector<std::shared_ptr<Asked>> asked;
  for (const Change& change : changes) {
    asked.push_back(
        send({.tick = 0, .axis = axis_, .owner = owner, .action = ParameterWrite{change.row, change.after}}));
    if (asked.back()->answer == Refused::kBusy) break;  // no room: the later ones must not overtake it
  }
  if (asked.back()->answer == Refused::kBusy) {
    for (std::size_t i = changes.size(); i-- > asked.size() - 1;)
      engine_.try_parameter(axis_, changes[i].row, changes[i].before);
  }
  Outcome outcome;
  for (const auto& each : asked) {
    const Refused why = co_await answer_to(each);
    if (why != Refused::kNot) outcome = refuse(why);
  }
  co_return outcome;
}

}  // namespace drivebench::modbus
