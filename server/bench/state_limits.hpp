#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "plant/axis_state.hpp"
#include "server/bench/safe_action.hpp"

/// What a saved state may hold: bytes from a client can be anything, and their digest is no signature.
namespace drivebench {

/// Whether a tick can go on from this state of an axis: finite quantities, counters and ticks that are exact
/// as doubles, gates and flags that exist.
bool is_possible(const AxisState& state) noexcept;

bool is_possible(const Command& command) noexcept;
bool is_possible(const LastCommands& last) noexcept;

/// Whether the number is a tick or a count that a bench can have come to: within kMaxTick, either sign.
bool is_possible_count(std::int64_t number) noexcept;

/// Sentences about bytes that Bench::restore() does not take.
std::string no_state(std::size_t bytes);
std::string longer_than_a_state(std::size_t state_bytes);

}  // namespace drivebench
