#include "server/bench/input.hpp"

#include <bit>
#include <cmath>

#include "plant/parameters/rows.hpp"
#include "protocols/text.hpp"

namespace drivebench {
namespace {

using Words = std::uint64_t[6];

// One pair of functions for each action with contents.
void put(Words& w, const Command& c) noexcept {
  w[0] = static_cast<std::uint64_t>(c.answers);
  w[1] = std::uint64_t{static_cast<std::uint32_t>(c.phases.gates)} | std::uint64_t{c.phases.legs_off} << 32;
  w[2] = std::bit_cast<std::uint64_t>(c.phases.setpoint.a);
  w[3] = std::bit_cast<std::uint64_t>(c.phases.setpoint.b);
  w[4] = std::bit_cast<std::uint64_t>(c.phases.setpoint.c);
  w[5] = std::bit_cast<std::uint64_t>(c.phases.setpoint.field);
}
void get(const Words& w, Command& c) noexcept {
  c.answers = static_cast<Tick>(w[0]);
  c.phases.gates = static_cast<Gates>(static_cast<std::uint32_t>(w[1]));
  c.phases.legs_off = static_cast<std::uint32_t>(w[1] >> 32);
  c.phases.setpoint = {.a = std::bit_cast<double>(w[2]),
                       .b = std::bit_cast<double>(w[3]),
                       .c = std::bit_cast<double>(w[4]),
                       .field = std::bit_cast<double>(w[5])};
}

void put(Words& w, const LeaseAction& action) noexcept {
  w[0] = static_cast<std::uint64_t>(action);
}
void get(const Words& w, LeaseAction& action) noexcept {
  action = static_cast<LeaseAction>(w[0]);
}

void put(Words& w, const LoadChange& change) noexcept {
  w[0] = std::bit_cast<std::uint64_t>(change.load_nm);
  w[1] = static_cast<std::uint64_t>(change.ramp_ticks);
}
void get(const Words& w, LoadChange& change) noexcept {
  change.load_nm = std::bit_cast<double>(w[0]);
  change.ramp_ticks = static_cast<Tick>(w[1]);
}

void put(Words& w, const ParameterWrite& write) noexcept {
  w[0] = write.row;
  w[1] = std::bit_cast<std::uint64_t>(write.value);
  w[2] = static_cast<std::uint64_t>(write.ramp_ticks);
}
void get(const Words& w, ParameterWrite& write) noexcept {
  write.row = static_cast<std::uint32_t>(w[0]);
  write.value = std::bit_cast<double>(w[1]);
  write.ramp_ticks = static_cast<Tick>(w[2]);
}

void put(Words& w, const InjectFault& fault) noexcept {
  w[0] = fault.row;
  w[1] = std::bit_cast<std::uint64_t>(fault.value);
}
void get(const Words& w, InjectFault& fault) noexcept {
  fault.row = static_cast<std::uint32_t>(w[0]);
  fault.value = std::bit_cast<double>(w[1]);
}

void put(Words& w, const ShaftBump& bump) noexcept {
  w[0] = std::bit_cast<std::uint64_t>(bump.impulse_nms);
}
void get(const Words& w, ShaftBump& bump) noexcept {
  bump.impulse_nms = std::bit_cast<double>(w[0]);
}

void put(Words& w, const Multisine& m) noexcept {
  w[0] = std::uint64_t{static_cast<std::uint32_t>(m.quantity)} | std::uint64_t{m.periods} << 32;
  w[1] = std::bit_cast<std::uint64_t>(m.amplitude);
  w[2] = m.lines.period_ticks;
  w[3] = std::uint64_t{m.lines.lowest} | std::uint64_t{m.lines.highest} << 32;
  w[4] = std::bit_cast<std::uint64_t>(m.lines.ratio);
}
void get(const Words& w, Multisine& m) noexcept {
  m.quantity = static_cast<Multisine::Quantity>(static_cast<std::uint32_t>(w[0]));
  m.periods = static_cast<std::uint32_t>(w[0] >> 32);
  m.amplitude = std::bit_cast<double>(w[1]);
  m.lines = {.period_ticks = static_cast<std::uint32_t>(w[2]),
             .lowest = static_cast<std::uint32_t>(w[3]),
             .highest = static_cast<std::uint32_t>(w[3] >> 32),
             .ratio = std::bit_cast<double>(w[4])};
}

void put(Words& w, const RefusedCommand& refused) noexcept {
  w[0] = refused.bad_values ? 1 : 0;
}
void get(const Words& w, RefusedCommand& refused) noexcept {
  refused.bad_values = w[0] != 0;
}

template <class Empty>
void put(Words&, const Empty&) noexcept {}
template <class Empty>
void get(const Words&, Empty&) noexcept {}

template <std::size_t Kind = 0>
void unpack_action(const PackedInput& packed, Input& input) noexcept {
  if constexpr (Kind < std::variant_size_v<decltype(input.action)>) {
    if (packed.kind != Kind) return unpack_action<Kind + 1>(packed, input);
    get(packed.words, input.action.template emplace<Kind>());
  }
}

}  // namespace

PackedInput pack(const Input& input) noexcept {
  PackedInput packed{
      .tick = input.tick, .axis = input.axis, .owner = input.owner, .kind = input.action.index()};
  std::visit([&packed](const auto& action) { put(packed.words, action); }, input.action);
  return packed;
}

Input unpack(const PackedInput& packed) noexcept {
  Input input{.tick = packed.tick,
              .axis = static_cast<std::uint32_t>(packed.axis),
              .owner = packed.owner,
              .action = {}};
  unpack_action(packed, input);
  return input;
}

Refused check_sender(const Input& input, Owner holder, bool takes_voltages) noexcept {
  if (concerns_all_axes(input)) return Refused::kNot;
  if (takes_voltages && !may_be_scheduled(input.action)) return Refused::kSharedAmplifier;
  const auto* const lease = std::get_if<LeaseAction>(&input.action);
  if (lease != nullptr && *lease == LeaseAction::kAcquire) {
    if (holder != 0 && holder != input.owner) return Refused::kOwned;
    return input.owner == 0 ? Refused::kNotOwner : Refused::kNot;
  }
  if (input.owner == 0) return may_be_scheduled(input.action) ? Refused::kNot : Refused::kNotOwner;
  return input.owner == holder ? Refused::kNot : Refused::kNotOwner;
}

bool is_finite(const PhaseCommand& command) noexcept {
  const PhaseValues& x = command.setpoint;
  return std::isfinite(x.a) && std::isfinite(x.b) && std::isfinite(x.c) && std::isfinite(x.field);
}

namespace {

void add_problem(const InjectableFault& fault, double value, Problems& found) {
  const double minimum = fault.magnitude ? -fault.maximum : 0.0;
  if (!std::isfinite(value)) {
    found.add(fault.name, "is not a finite number");
  } else if (value < minimum || value > fault.maximum) {
    found.add(fault.name, [&] {
      return "is " + shortest(value) + " but must lie between " + shortest(minimum) + " and " +
             shortest(fault.maximum) + " " + std::string(fault.unit);
    });
  } else if (fault.integer && value != std::floor(value)) {
    found.add(fault.name, [&] { return "is " + shortest(value) + " but must be a whole number"; });
  }
}

}  // namespace

bool breaks_a_rule(const InjectableFault& fault, double value) noexcept {
  Problems found;
  add_problem(fault, value, found);
  return found.any();
}

std::string problem_with(const InjectableFault& fault, double value) {
  std::vector<Problem> sentences;
  Problems found(sentences);
  add_problem(fault, value, found);
  return found.any() ? sentences.front().rule : std::string();
}

}  // namespace drivebench
