#pragma once

#include <cstdint>

#include "server/bench/bench.hpp"
#include "tests/plant/servo_axis.hpp"
#include "tests/server/parameter_row.hpp"

/// A bench with the servo motor of the book, and short forms of its inputs.
namespace drivebench {

inline BenchSetup servo_setup(int command_delay_ticks = 0) {
  BenchSetup setup;
  setup.command_delay_ticks = command_delay_ticks;
  setup.axes.push_back({.parameters = servo_axis()});
  return setup;
}

inline Refused submit_lease(Bench& bench, LeaseAction action, Owner owner) {
  return bench.submit({.tick = bench.tick(), .axis = 0, .owner = owner, .action = action});
}

inline Command volts_in_answer_to(Tick answers, double a_v, double b_v = 0.0) {
  return {.answers = answers, .phases = {.gates = Gates::kVoltage, .setpoint = {.a = a_v, .b = b_v}}};
}

/// A command for the present tick.
inline Refused submit_volts(Bench& bench, Owner owner, double a_v, double b_v = 0.0) {
  return bench.submit({.tick = bench.tick(),
                       .axis = 0,
                       .owner = owner,
                       .action = volts_in_answer_to(bench.tick(), a_v, b_v)});
}

inline Bench owned_bench(const BenchSetup& setup, Owner owner, BenchObserver* observer = nullptr) {
  Bench bench(setup, observer);
  submit_lease(bench, LeaseAction::kAcquire, owner);
  return bench;
}

inline Refused submit_clear(Bench& bench, Owner owner) {
  return bench.submit({.tick = bench.tick(), .axis = 0, .owner = owner, .action = ClearFaults{}});
}

inline void step(Bench& bench, int ticks) {
  for (int i = 0; i < ticks; ++i)
    bench.step();
}

inline ControlState state_of(const Bench& bench) {
  return static_cast<ControlState>(bench.sample(0).state);
}

}  // namespace drivebench
