#pragma once

#include <cstdint>

namespace drivebench::simulator {

/// Runs the servo axis of configs/benches/servo.toml for so many seconds of plant time under a random
/// schedule of faults, silence, loads and changes, as fast as possible. Every hour of plant time its state
/// goes through bytes into a new bench. Returns 0 if every promise held, and prints counts.
int run_long(std::uint64_t seconds, std::uint64_t seed);

}  // namespace drivebench::simulator
