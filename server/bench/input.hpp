#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <variant>

#include "plant/drive/drive.hpp"
#include "plant/injected_faults.hpp"
#include "plant/tick.hpp"
#include "protocols/condition.hpp"
#include "protocols/multisine.hpp"
#include "protocols/refusals.hpp"
#include "protocols/signals/command.hpp"

namespace drivebench {

/// Number of a session; 0: no session.
using Owner = std::uint64_t;

/// An action of a session on the lease of an axis.
enum class LeaseAction : std::uint32_t {
  kAcquire = 1,
  kRenew = 2,
  kRelease = 3,
  kLost = 4,  ///< the session ended without a release
};

/// A load torque to go to, at once or in a ramp; positive opposes a positive machine torque.
struct LoadChange {
  double load_nm;
  Tick ramp_ticks;
};

/// A parameter to change, already checked against its limits. The rules between values are checked when it
/// acts.
struct ParameterWrite {
  std::uint32_t row;  ///< of axis_parameters() of the axis
  double value;
  Tick ramp_ticks = 0;  ///< 0: a step; else linear from the present value, real numbers only
};

/// A fault to put into the axis, already checked; a value of 0 takes it away.
struct InjectFault {
  std::uint32_t row;  ///< of kInjectableFaults
  double value;
};

/// A bump of the shaft: an angular impulse, all of it at once.
struct ShaftBump {
  double impulse_nms;  ///< positive like a machine torque
};

/// A sum of sines on a quantity of the axis, on top of the value in force: what a frequency response is
/// measured with.
struct Multisine {
  enum class Quantity : std::uint32_t { kLoad, kCurrentOffset };
  Quantity quantity;
  std::uint32_t periods;
  double amplitude;  ///< of each line [N·m] or [A]
  MultisineLines lines;
};

struct ClearFaults {};  ///< by the owner only
struct LateTick {};     ///< the tick of this input started late; concerns the whole bench
struct Overrun {};      ///< late beyond the limit: safe action on every axis
/// A command of the controller was turned away before it reached the bench.
struct RefusedCommand {
  bool bad_values = false;  ///< for its values, not for its time
};

using Action = std::variant<ClearFaults, Command, LeaseAction, LoadChange, ParameterWrite, LateTick, Overrun,
                            RefusedCommand, InjectFault, ShaftBump, Multisine>;

/// Everything that can change a run from outside, with the tick at whose start it takes effect.
struct Input {
  Tick tick = 0;
  std::uint32_t axis = 0;
  Owner owner = 0;
  Action action;
};
static_assert(std::is_trivially_copyable_v<Input>);

/// What lets an event happen: a condition that has held for some time.
struct Trigger {
  std::uint32_t axis = 0;  ///< whose samples the condition sees
  Condition condition;
  Tick for_ticks = 0;  ///< the condition holds in the samples of so many ticks before, too
};

/// An input as words, for saved states and hashes; without the edges of a command, which never waits.
struct PackedInput {
  Tick tick = 0;
  std::uint64_t axis = 0;
  Owner owner = 0;
  std::uint64_t kind = 0;  ///< index of the action
  std::uint64_t words[6] = {};
};

PackedInput pack(const Input& input) noexcept;

/// The input; a kind that does not exist gives ClearFaults without an owner, which every axis refuses.
Input unpack(const PackedInput& packed) noexcept;

/// Whether an action may be given for a later tick. All others act in the tick in which they come.
inline bool may_be_scheduled(const Action& action) noexcept {
  return std::holds_alternative<LoadChange>(action) || std::holds_alternative<ParameterWrite>(action) ||
         std::holds_alternative<InjectFault>(action) || std::holds_alternative<ShaftBump>(action) ||
         std::holds_alternative<Multisine>(action);
}

/// Whether the input concerns the whole bench: the clock sends it, not a client.
inline bool concerns_all_axes(const Input& input) noexcept {
  return std::holds_alternative<LateTick>(input.action) || std::holds_alternative<Overrun>(input.action);
}

/// The reason why the sender has no right to the input while `holder` holds the lease of its axis; 0: no
/// session does. Loads, parameters, faults, bumps and multisines may also come without an owner: from the
/// configuration, from an experiment, or from a client of a free run. An axis that takes the voltages of
/// another one has no lease of its own and no commands: the holder is that of the other axis.
Refused check_sender(const Input& input, Owner holder, bool takes_voltages) noexcept;

/// Whether the input gives a lease up.
inline bool ends_lease(const Input& input) noexcept {
  const auto* const action = std::get_if<LeaseAction>(&input.action);
  return action != nullptr && (*action == LeaseAction::kRelease || *action == LeaseAction::kLost);
}

/// Whether a command was refused for its values.
constexpr bool are_bad_values(Refused why) noexcept {
  return why == Refused::kNotFinite || why == Refused::kWrongDrive || why == Refused::kBeyondDrive;
}

/// Whether all set-points are finite numbers.
bool is_finite(const PhaseCommand& command) noexcept;

/// Whether a drive of this kind takes commands of this kind: only a current-mode amplifier takes currents,
/// only a switched inverter edges.
constexpr bool suits(DriveKind drive, Gates gates) noexcept {
  if (gates == Gates::kEdges) return drive == DriveKind::kSwitched;
  return gates != Gates::kCurrent || drive == DriveKind::kCurrent;
}

/// The reason why the fault cannot have this value: a sentence with value and rule, or empty if it can.
std::string problem_with(const InjectableFault& fault, double value);
/// Whether problem_with() finds a problem; for the tick: no text, no allocation.
bool breaks_a_rule(const InjectableFault& fault, double value) noexcept;

/// The last tick that a client may name: a double holds every integer up to here exactly.
inline constexpr std::uint64_t kMaxTick = std::uint64_t{1} << 53;

/// Largest amounts, in both directions, that configurations and clients may ask for.
inline constexpr double kMaxLoadNm = 1e6;
inline constexpr double kMaxImpulseNms = 1e6;
/// Of a line, so that the sum of all stays within a load or the offset of a sensor.
inline constexpr double kMaxMultisineAmplitude = 1e4;

}  // namespace drivebench
