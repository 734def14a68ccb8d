// Runs a bench through a script that touches every branch of the servo, then one with every kind of machine,
// drive and sensor through every fault, and prints the state hash every 1000 ticks. Built several times with
// different compilers and options: all must print the same.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "plant/math/trig.hpp"
#include "plant/parameters/parameters.hpp"
#include "server/bench/bench.hpp"
#include "tests/determinism/zoo.hpp"

namespace drivebench {
namespace {

constexpr Owner kController = 7;

AxisParameters noisy_servo() {
  AxisParameters p;
  p.machine = InductionMachineParameters{.pole_pairs = 3,
                                         .stator_resistance_ohm = 1.7,
                                         .rotor_resistance_ohm = 3.9,
                                         .stator_inductance_h = 0.014,
                                         .rotor_inductance_h = 0.014,
                                         .mutual_inductance_h = 0.0117};
  p.mechanics = {.inertia_kgm2 = 1.1e-4, .viscous_friction_nms = 1.4e-4};
  p.drive.amplifier = {.voltage_limit_v = 80.0, .gain = 1.01, .offset_a_v = 0.3, .offset_b_v = -0.2};
  p.drive.amplifier.over_current_a = 9.0;
  p.drive.amplifier.over_current_trip = false;
  p.sensors.current = {.bits = 12, .full_scale_a = 20.0, .gain_a = 1.02, .offset_b_a = 0.05};
  p.sensors.current.noise_rms_a = 0.02;
  return p;
}

BenchSetup two_axes() {
  AxisSetup first{.parameters = noisy_servo()};
  AxisSetup second{.parameters = noisy_servo(), .on_link_loss = SafeAction::kZeroVoltage};
  second.parameters.mechanics.coulomb_friction_nm = 0.02;
  second.parameters.mechanics.static_friction_nm = 0.03;
  second.parameters.encoder = {.counts_per_revolution = 4096, .half_count_offset = true};
  second.parameters.drive.amplifier.over_current_trip = true;
  second.parameters.sensors.current.bits = 0;
  return {.seed = 12345, .axes = {first, second}};
}

std::uint32_t row_of(const char* name) {
  const AxisParameters p = noisy_servo();
  const Parameter* row = find_parameter(p, name);
  if (row == nullptr) std::abort();
  return static_cast<std::uint32_t>(row - axis_parameters(p).data());
}

/// A voltage that turns with the measured angle plus a slip, and answers the measured current: a difference
/// in rounding comes back and grows.
Command answer(const Sample& s, double amplitude_v, double slip_rad_s) {
  const double electrical_rad = 3.0 * static_cast<double>(s.encoder_count % 2000) * 3.14159e-3;
  const CosSin turning = cos_sin(electrical_rad + slip_rad_s * 125e-6 * static_cast<double>(s.tick));
  return {.answers = static_cast<Tick>(s.tick),
          .phases = {.gates = Gates::kVoltage,
                     .setpoint = {.a = amplitude_v * turning.cos - 1.3 * s.i_a_a,
                                  .b = amplitude_v * turning.sin - 1.3 * s.i_b_a}}};
}

Command one_of_the_script(const Sample& s) {
  const Tick phase = static_cast<Tick>(s.tick) % 4000;
  if (phase < 1500) return answer(s, 40.0, 120.0);
  if (phase < 2200) return answer(s, 70.0, -200.0);  // reverses: the shaft passes through standstill
  Command command = answer(s, 100.0, 300.0);         // saturates, and exceeds the current limit
  if (phase >= 3000) command.phases.gates = Gates::kOff;
  if (phase >= 3600) command.phases.gates = Gates::kZeroVoltage;
  return command;
}

void print_hash(const Bench& bench) {
  std::printf("%lld %016llx\n", static_cast<long long>(bench.tick()),
              static_cast<unsigned long long>(bench.state_hash()));
}

/// Setpoints that turn and answer the measured currents.
Command setpoint_of(const Bench& bench, std::size_t axis) {
  const Sample& s = bench.sample(axis);
  const DriveParameters& drive = bench.axis(axis).parameters().drive;
  const bool currents = drive.kind == DriveKind::kCurrent;
  const double most = 0.7 * (currents ? drive.current_loop.limit_a : drive.amplifier.voltage_limit_v);
  const double angle_rad = 0.04 * static_cast<double>(s.tick) + 1e-4 * static_cast<double>(s.encoder_count);
  const auto wave = [&](double lag_rad, double i_a) {
    return most * cos_sin(angle_rad - lag_rad).cos - 0.3 * i_a;
  };
  const Gates on = currents ? Gates::kCurrent : Gates::kVoltage;
  return {.answers = static_cast<Tick>(s.tick),
          .phases = {.gates = s.tick % 900 > 800 ? Gates::kOff : on,
                     .setpoint = {.a = wave(0.0, s.i_a_a),
                                  .b = wave(2.0944, s.i_b_a),
                                  .c = wave(4.1888, s.i_c_a),
                                  .field = 0.1 * most - 0.1 * s.i_f_a}}};
}

/// Every fault for a while, one after the other; parameters ramped away and back; bumps and loads.
void disturb(Bench& bench, std::uint32_t axis) {
  const Tick tick = bench.tick();
  const auto submit = [&](const Action& action) {
    bench.submit({.tick = tick, .axis = axis, .owner = kController, .action = action});
  };
  const auto row = static_cast<std::uint32_t>((tick / 60 + axis) % static_cast<Tick>(kInjectableFaultCount));
  const InjectableFault& fault = kInjectableFaults[row];
  const double value = fault.integer ? (fault.maximum < 2.0 ? 1.0 : 2.0) : 0.05 * fault.maximum;
  if (tick % 60 == 0 && value < 1e3) submit(InjectFault{.row = row, .value = value});
  if (tick % 60 == 40) submit(InjectFault{.row = row, .value = 0.0});
  if (tick % 60 == 50) submit(ClearFaults{});
  if (tick % 300 == 7) submit(ShaftBump{.impulse_nms = 1e-3});
  if (tick % 300 == 100) submit(LoadChange{.load_nm = 0.02, .ramp_ticks = 50});
  const AxisParameters& p = bench.axis(axis).parameters();
  const auto friction = static_cast<std::uint32_t>(find_parameter(p, "mechanics.viscous_friction_nms") -
                                                   axis_parameters(p).data());
  if (tick % 200 == 0) {
    submit(ParameterWrite{.row = friction, .value = tick % 400 == 0 ? 2e-3 : 1e-3, .ramp_ticks = 150});
  }
  submit(setpoint_of(bench, axis));
}

int run_zoo(Tick ticks) {
  Bench bench(zoo());
  std::vector<bool> turned(bench.axis_count());
  for (std::uint32_t axis = 0; axis < bench.axis_count(); ++axis)
    bench.submit({.tick = 0, .axis = axis, .owner = kController, .action = LeaseAction::kAcquire});
  while (bench.tick() < ticks) {
    for (std::uint32_t axis = 0; axis < bench.axis_count(); ++axis)
      disturb(bench, axis);
    bench.step();
    for (std::size_t axis = 0; axis < turned.size(); ++axis)
      turned[axis] =
          turned[axis] || (bench.sample(axis).speed_rad_s != 0.0 && bench.sample(axis).i_a_a != 0.0);
    if (bench.tick() % 1000 == 0) print_hash(bench);
  }
  for (std::size_t axis = 0; axis < turned.size(); ++axis) {
    const bool diverged = (bench.sample(axis).faults & kDiverged) != 0;
    if (turned[axis] && !diverged) continue;
    std::fprintf(stderr, "axis %zu of the zoo %s\n", axis, diverged ? "diverged" : "did not turn");
    return 1;
  }
  return 0;
}

int run(Tick ticks) {
  Bench bench(two_axes());
  const auto submit = [&bench](std::uint32_t axis, const auto& action, Tick tick = 0) {
    bench.submit({.tick = tick, .axis = axis, .owner = kController, .action = action});
  };
  for (std::uint32_t axis = 0; axis < 2; ++axis)
    submit(axis, LeaseAction::kAcquire);
  submit(0, LoadChange{.load_nm = 0.05, .ramp_ticks = 333}, 700);
  submit(1, LoadChange{.load_nm = -0.1, .ramp_ticks = 0}, 1200);
  submit(0, ParameterWrite{row_of("machine.rotor_resistance_ohm"), 5.1}, 2500);
  submit(1, ParameterWrite{row_of("mechanics.inertia_kgm2"), 2.3e-4}, 6100);
  std::uint64_t seen = 0;
  while (bench.tick() < ticks) {
    for (std::uint32_t axis = 0; axis < 2; ++axis) {
      const bool silent = bench.tick() % 5000 > 4970;  // long enough for the watchdog
      if (!silent) submit(axis, one_of_the_script(bench.sample(axis)));
      if (bench.tick() % 1000 == 999) submit(axis, ClearFaults{});
    }
    bench.step();
    for (std::size_t axis = 0; axis < 2; ++axis)
      seen |= bench.sample(axis).faults;
    if (bench.tick() % 1000 == 0) print_hash(bench);
  }
  constexpr std::uint64_t kWanted = kVoltageSaturated | kCurrentSensorSaturated | kOverCurrent | kShaftHeld |
                                    kOverCurrentTrip | kCommandTimeout;
  if (ticks >= 20'000 && (seen & kWanted) != kWanted) {
    std::fprintf(stderr, "the script no longer reaches every branch: faults seen %llx\n",
                 static_cast<unsigned long long>(seen));
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace drivebench

int main(int argc, char** argv) {
  const drivebench::Tick ticks = argc > 1 ? std::atoll(argv[1]) : 20'000;
  const int servo = drivebench::run(ticks);
  return servo != 0 ? servo : drivebench::run_zoo(ticks / 4);
}
