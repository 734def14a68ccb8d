#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace drivebench {

/// Bits of the fault word of an axis. Bits from kOverCurrentTrip on are latched until the owner clears them.
inline constexpr std::uint64_t kVoltageSaturated = 1u << 0;
inline constexpr std::uint64_t kCurrentSensorSaturated = 1u << 1;
inline constexpr std::uint64_t kOverCurrent = 1u << 2;
inline constexpr std::uint64_t kShaftHeld = 1u << 3;
inline constexpr std::uint64_t kSensorSaturated = 1u << 4;
inline constexpr std::uint64_t kCommandSlewLimited = 1u << 5;
inline constexpr std::uint64_t kBootstrapEmpty = 1u << 6;
inline constexpr std::uint64_t kOverCurrentTrip = 1u << 8;
inline constexpr std::uint64_t kCommandTimeout = 1u << 9;
inline constexpr std::uint64_t kLeaseLost = 1u << 10;
inline constexpr std::uint64_t kBenchOverrun = 1u << 11;
inline constexpr std::uint64_t kDiverged = 1u << 12;
inline constexpr std::uint64_t kBreakInput = 1u << 13;

inline constexpr std::uint64_t kLatchedFaults =
    kOverCurrentTrip | kCommandTimeout | kLeaseLost | kBenchOverrun | kDiverged | kBreakInput;

/// Latched faults that keep the gates off.
inline constexpr std::uint64_t kGatesOffFaults = kOverCurrentTrip | kBreakInput;

/// Name and meaning of a fault bit.
struct FaultInfo {
  std::uint64_t bit;
  std::string_view name;
  std::string_view meaning;
};

inline constexpr auto kFaultTable = std::to_array<FaultInfo>({
    {kVoltageSaturated, "voltage_saturated", "the amplifier clipped a phase voltage in this tick"},
    {kCurrentSensorSaturated, "current_sensor_saturated", "a current converter was at the end of its range"},
    {kOverCurrent, "over_current", "a phase current exceeded amplifier.over_current_a in this tick"},
    {kShaftHeld, "shaft_held", "stiction or a lock held the shaft at the end of this tick"},
    {kSensorSaturated, "sensor_saturated", "the converter of another sensor was at the end of its range"},
    {kCommandSlewLimited, "command_slew_limited", "a set-point moved faster than slew_per_s and was slowed"},
    {kBootstrapEmpty, "bootstrap_empty",
     "an upper switch had no supply in this tick; its leg is on its diodes"},
    {kOverCurrentTrip, "over_current_trip", "latched: over-current switched the gates off"},
    {kCommandTimeout, "command_timeout",
     "latched: no command for watchdog_ticks ticks, safe action in force"},
    {kLeaseLost, "lease_lost", "latched: the controller left or let its lease run out"},
    {kBenchOverrun, "bench_overrun", "latched: the bench was late beyond max_lateness and resynchronised"},
    {kDiverged, "diverged", "latched: a plant state left its envelope; the last finite outputs are held"},
    {kBreakInput, "break_input", "latched: the break input opened all legs, by a current or the fault line"},
});

}  // namespace drivebench
