#pragma once

#include <cstdint>
#include <string_view>
#include <type_traits>
#include <variant>

#include "plant/amplifier.hpp"
#include "plant/tick.hpp"

namespace drivebench {

/// Number of a session; 0 is nobody.
using Owner = std::uint64_t;

/// What a controller asks for, in answer to the sample of `answers`.
struct Command {
  Tick answers = -1;
  PhaseCommand phases;
};

/// What a session does with the lease of an axis.
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

/// A parameter to change, already checked against its limits and rules.
struct ParameterWrite {
  std::uint32_t row;  ///< of axis_parameters()
  double value;
};

struct ClearFaults {};     ///< by the owner only
struct LateTick {};        ///< the tick of this input started late; concerns the whole bench
struct Overrun {};         ///< late beyond the limit: safe action on every axis
struct RefusedCommand {};  ///< a command for this axis was turned away before it reached the bench

/// Everything that can change a run from outside, with the tick at whose start it takes effect.
struct Input {
  Tick tick = 0;
  std::uint32_t axis = 0;
  Owner owner = 0;
  std::variant<ClearFaults, Command, LeaseAction, LoadChange, ParameterWrite, LateTick, Overrun,
               RefusedCommand>
      action;
};
static_assert(std::is_trivially_copyable_v<Input>);

/// An input as words, for saved states and hashes.
struct PackedInput {
  Tick tick = 0;
  std::uint64_t axis = 0;
  Owner owner = 0;
  std::uint64_t kind = 0;  ///< index of the action
  std::uint64_t words[4] = {};
};

PackedInput pack(const Input& input) noexcept;

/// The input; a kind that does not exist gives ClearFaults by nobody, which nobody may do.
Input unpack(const PackedInput& packed) noexcept;

/// Why the bench did not do what an input asked for.
enum class Refused : std::uint32_t {
  kNot,
  kUnknownAxis,
  kNotOwner,
  kOwned,
  kNotFinite,
  kLatched,
  kStale,
  kBusy
};

/// The reason for people; empty for kNot.
std::string_view sentence_of(Refused why) noexcept;

}  // namespace drivebench
