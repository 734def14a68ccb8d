#include "server/bench/state_limits.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <initializer_list>

#include "server/bench/input.hpp"

namespace drivebench {
namespace {

// The largest speed and current of a machine that has not diverged, and more than any set-point.
constexpr double kLargestQuantity = 1e9;

bool is_quantity(double x) noexcept {
  return std::isfinite(x) && std::abs(x) <= kLargestQuantity;
}

/// A finite number, a count or a set of bits.
bool is_possible_word(std::uint64_t word) noexcept {
  return is_possible_count(static_cast<std::int64_t>(word)) || std::isfinite(std::bit_cast<double>(word));
}

template <class Block>
bool has_possible_words(const Block& block) noexcept {
  static_assert(sizeof(Block) % 8 == 0);
  for (std::size_t at = 0; at < sizeof(Block); at += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, reinterpret_cast<const std::byte*>(&block) + at, sizeof(word));
    if (!is_possible_word(word)) return false;
  }
  return true;
}

bool are_possible_counts(std::initializer_list<std::int64_t> numbers) noexcept {
  return std::ranges::all_of(numbers, is_possible_count);
}

bool is_flag(std::int64_t number) noexcept {
  return number == 0 || number == 1;
}

bool is_possible(const TwoMassState& shaft) noexcept {
  return is_quantity(shaft.speed_rad_s) && is_quantity(shaft.load_speed_rad_s) &&
         is_quantity(shaft.twist_rad) && shaft.angle_rad >= 0.0 && shaft.angle_rad <= kTurnRad;
}

bool is_possible(const EncoderState& e) noexcept {
  return are_possible_counts({e.count, e.last_edge_tick, e.index_tick, e.index_count, e.ahead}) &&
         e.edges_seen >= 0 && e.edges_seen <= 2 && std::abs(e.direction) <= 1 && is_flag(e.direction_changed);
}

bool is_possible(const PhaseCommand& command) noexcept {
  const PhaseValues& x = command.setpoint;
  return command.gates >= Gates::kOff && command.gates <= Gates::kEdges && command.legs_off <= kAllLegs &&
         is_quantity(x.a) && is_quantity(x.b) && is_quantity(x.c) && is_quantity(x.field);
}

bool is_possible(const DriveMemory& m) noexcept {
  return std::ranges::all_of(m.commands, [](const PhaseCommand& c) { return is_possible(c); }) &&
         m.pwm_segment >= 0 && m.pwm_segment < static_cast<std::int64_t>(kMaxSegmentsOfPattern) &&
         is_quantity(m.bus_v) && m.bus_v >= 0.0;
}

/// The faults keep to the limits that a client meets.
bool is_possible(const InjectedFaults& injected) noexcept {
  return std::ranges::none_of(kInjectableFaults, [&injected](const InjectableFault& fault) {
    return breaks_a_rule(fault, injected.*fault.member);
  });
}

}  // namespace

bool is_possible_count(std::int64_t number) noexcept {
  constexpr auto kMost = static_cast<std::int64_t>(kMaxTick);
  return number >= -kMost && number <= kMost;
}

bool is_possible(const Command& command) noexcept {
  return is_possible_count(command.answers) && is_possible(command.phases);
}

bool is_possible(const LastCommands& last) noexcept {
  return is_possible(last.command) && is_quantity(last.angle_rad) && is_quantity(last.turn_rad_per_tick) &&
         are_possible_counts({last.followed, last.gone}) && last.followed >= 0 && last.gone >= 0;
}

bool is_possible(const AxisState& s) noexcept {
  return has_possible_words(s) && std::ranges::all_of(s.machine, is_quantity) && is_possible(s.shaft) &&
         is_possible_count(s.turns) && is_possible(s.encoder) &&
         s.load.is_within(kMaxLoadNm, static_cast<Tick>(kMaxTick)) && is_possible(s.drive) &&
         is_possible_count(s.sensors.tick) && s.sensors.tick >= 0 && is_possible(s.injected) &&
         s.open_terminals <= kAllLegs && std::ranges::all_of(s.comparators.edge_tick, is_possible_count) &&
         s.comparators.levels <= kAllLegs && are_possible_counts({s.hall.sector, s.hall.edge_tick}) &&
         s.hall.lines <= kAllLegs && s.bootstrap.empty <= kAllLegs &&
         std::ranges::all_of(s.bootstrap.level, [](std::int64_t level) { return std::abs(level) <= 1; });
}

std::string no_state(std::size_t bytes) {
  return "these " + std::to_string(bytes) + " bytes are no state of this bench";
}

std::string longer_than_a_state(std::size_t state_bytes) {
  return "a state of this bench has " + std::to_string(state_bytes) + " bytes, and this one is longer";
}

}  // namespace drivebench
