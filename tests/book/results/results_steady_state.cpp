#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "clients/models/induction_circuit.hpp"
#include "plant/machines/induction/induction_machine.hpp"
#include "tests/book/book_bench.hpp"
#include "tests/book/results/results.hpp"

namespace drivebench {
namespace {

using Mode = InductionCircuit::Mode;

constexpr double kLine_hz = 60.0;
constexpr double kSettled_s = 3.0;  // of im-b: its slowest time constant is a tenth of it

BenchConfig line_bench() {
  return load_config(std::string(DRIVEBENCH_CONFIGS) + "/benches/im-b.toml");
}

/// The circuit of the bench im-b on its line.
InductionCircuit line_circuit() {
  const BenchConfig config = line_bench();
  const AxisParameters& p = config.setup.axes[0].parameters;
  const auto& m = std::get<InductionMachineParameters>(p.machine);
  return {.motor = {.machine = {.pole_pairs = static_cast<double>(m.pole_pairs),
                                .mutual_inductance_h = m.mutual_inductance_h,
                                .rotor_resistance_ohm = m.rotor_resistance_ohm,
                                .rotor_inductance_h = m.rotor_inductance_h,
                                .friction_nms = p.mechanics.viscous_friction_nms,
                                .inertia_kgm2 = p.mechanics.inertia_kgm2},
                    .stator_resistance_ohm = m.stator_resistance_ohm,
                    .stator_inductance_h = m.stator_inductance_h},
          .star = true,
          .voltage_v = p.drive.source.amplitude_v / std::numbers::sqrt2,
          .frequency_hz = p.drive.source.frequency_hz};
}

/// A machine without stator resistance: L_S = L_R.
InductionCircuit lossless_stator(double pole_pairs, double inductance_h, double mutual_h, double rotor_ohm,
                                 double voltage_v) {
  return {.motor = {.machine = {.pole_pairs = pole_pairs,
                                .mutual_inductance_h = mutual_h,
                                .rotor_resistance_ohm = rotor_ohm,
                                .rotor_inductance_h = inductance_h,
                                .friction_nms = 0.0,
                                .inertia_kgm2 = 1.0},
                    .stator_resistance_ohm = 0.0,
                    .stator_inductance_h = inductance_h},
          .star = true,
          .voltage_v = voltage_v,
          .frequency_hz = kLine_hz};
}

/// The last sample of the bench at an imposed speed.
Sample imposed(double speed_rad_s) {
  BenchConfig config = line_bench();
  auto& m = config.setup.axes[0].parameters.mechanics;
  m.motion = ShaftMotion::kImposed;
  m.imposed_speed_rad_s = speed_rad_s;
  BookBench run(config);
  run.run_until(kSettled_s);
  return run.sample();
}

Sample under_load(double load_nm) {
  BenchConfig config = line_bench();
  config.axes[0].events = {{.tick = 10'000, .action = LoadChange{.load_nm = load_nm, .ramp_ticks = 0}}};
  BookBench run(config);
  run.run_until(kSettled_s);
  return run.sample();
}

Result no_load_and_locked() {
  const InductionCircuit circuit = line_circuit();
  const Sample no_load = imposed(circuit.synchronous_rad_s());
  const Sample locked = imposed(0.0);
  const InductionCircuit::Point standing = circuit.at(1.0);
  return {"AC-22",
          "the motor of problem 7.18 on 208 V, `im-b`: currents at no load and locked, its power factor and "
          "torque",
          "an exercise; derived 1.30525 A, 8.41017 A, 0.25455, 3.01369 N m",
          {number("circuit", std::abs(circuit.at(0.0).stator_a), "A"),
           number("", std::abs(standing.stator_a), "A"), number("", standing.power_factor(), ""),
           number("", standing.torque_nm, "N m"), number("running bench", no_load.meter_i_rms_a, "A"),
           number("", locked.meter_i_rms_a, "A"),
           number("", locked.meter_p_w / std::hypot(locked.meter_p_w, locked.meter_q_var), ""),
           number("", locked.torque_nm, "N m")},
          "agrees; `drivebench steady-state im-b --voltage 120.1 --frequency 60` prints the circuit's"};
}

Result pull_out() {
  const InductionCircuit circuit = line_circuit();
  const InductionCircuit::Point point = circuit.at(circuit.pull_out_slip(Mode::kMotor));
  return {"AC-22",
          "its pull-out torque, and the slip",
          "an exercise; derived 9.46348 N m at 0.1512",
          {number("circuit", point.torque_nm, "N m"), number("", point.slip, ""),
           number("bench at that speed", imposed(point.speed_rad_s).torque_nm, "N m")},
          "agrees"};
}

Result loads() {
  const InductionCircuit circuit = line_circuit();
  std::vector<Measured> measured;
  for (const double load_nm : {2.0, 5.0, 9.0})
    measured.push_back(number(load_nm == 2.0 ? "circuit" : "",
                              circuit.at(*circuit.slip_under(load_nm)).speed_rad_s, "rad/s"));
  for (const double load_nm : {2.0, 5.0, 9.0})
    measured.push_back(
        number(load_nm == 2.0 ? "running bench" : "", under_load(load_nm).speed_rad_s, "rad/s"));
  return {"AC-22", "its speed under 2, 5 and 9 N m", "an exercise; derived 123.803, 120.554, 112.099 rad/s",
          std::move(measured), "agrees"};
}

Result power_split() {
  const InductionCircuit circuit = line_circuit();
  const InductionCircuit::Point p = circuit.at(*circuit.slip_under(5.0));
  const Sample s = under_load(5.0);
  const double stator_w = 3.0 * circuit.motor.stator_resistance_ohm * s.meter_i_rms_a * s.meter_i_rms_a;
  const double shaft_w = s.torque_nm * s.speed_rad_s;
  return {"P3-07",
          "its powers under 5 N m: from the line, loss of the stator, loss of the rotor, mechanical",
          "the rotor's loss is S times what crosses the air gap",
          {number("circuit", p.active_w, "W"), number("", p.stator_loss_w, "W"),
           number("", p.rotor_loss_w, "W"), number("", p.mechanical_w, "W"),
           number("meter and shaft of the bench", s.meter_p_w, "W"), number("", stator_w, "W"),
           number("", s.meter_p_w - stator_w - shaft_w, "W"), number("", shaft_w, "W")},
          "agrees; the rotor's loss of the bench is what remains of the other three"};
}

Result servo_circle() {
  const InductionCircuit servo = lossless_stator(3.0, 0.014, 0.0117, 3.9, 80.0);
  const InductionCircuit::Point no_load = servo.at(0.0);
  const double i_0 = std::abs(no_load.stator_a);
  const InductionCircuit::Point rated = servo.at(servo.rated_slip());
  const InductionCircuit::Circle circle = servo.circle();
  return {
      "7.17",
      "the servo motor on 80 V and 60 Hz without R_S: S_p, S_r, I_S0, I_Sr, cos phi_r, pull-out torque; "
      "centre and radius of "
      "the circle over I_S0",
      "an exercise; derived 2.45019, 1.34556, 15.1576 A, 27.6012 A, 0.536592, 33.5207 N m; 2.15793, 1.15793",
      {number("", servo.pull_out_slip(Mode::kMotor), ""), number("", rated.slip, ""), number("", i_0, "A"),
       number("", std::abs(rated.stator_a), "A"), number("", rated.power_factor(), ""),
       number("", servo.at(servo.pull_out_slip(Mode::kMotor)).torque_nm, "N m"),
       number("", std::abs(circle.centre_a) / i_0, ""), number("", circle.radius_a / i_0, "")},
      "agrees; slips above 1: a small rotor of high resistance"};
}

Result largest_power() {
  // sigma = 0.05 and S_p = R_R/(sigma w L_R) = 0.1.
  constexpr double kLeakage = 0.05;
  constexpr double kInductance = 0.2;
  const double omega = 2.0 * std::numbers::pi * kLine_hz;
  const InductionCircuit machine = lossless_stator(1.0, kInductance, kInductance * std::sqrt(1.0 - kLeakage),
                                                   0.1 * kLeakage * omega * kInductance, 120.0);
  const double pull_out_w =
      machine.at(machine.pull_out_slip(Mode::kMotor)).torque_nm * machine.synchronous_rad_s();
  const InductionCircuit::Point motor = machine.at(machine.largest_power_slip(Mode::kMotor));
  const InductionCircuit::Point generator = machine.at(machine.largest_power_slip(Mode::kGenerator));
  return {"7.26",
          "largest mechanical power without R_S, sigma = 0.05, S_p = 0.1: slip and power over pull-out "
          "torque times synchronous "
          "speed; of a generator",
          "an exercise; derived 0.0904988, 0.904988; -0.1104988, -1.104988",
          {number("", motor.slip, ""), number("", motor.mechanical_w / pull_out_w, ""),
           number("generator", generator.slip, ""), number("", generator.mechanical_w / pull_out_w, "")},
          "agrees"};
}

Result line_start() {
  BookBench run("im-b");
  const double synchronous = line_circuit().synchronous_rad_s();
  double at_95_s = 0.0;
  double at_99_s = 0.0;
  double peak_rad_s = 0.0;
  double peak_a = 0.0;
  run.run_until(1.0, [&](const Sample& s) {
    if (at_95_s == 0.0 && s.speed_rad_s > 0.95 * synchronous) at_95_s = run.now_s();
    if (at_99_s == 0.0 && s.speed_rad_s > 0.99 * synchronous) at_99_s = run.now_s();
    peak_rad_s = std::max(peak_rad_s, s.speed_rad_s);
    peak_a = std::max({peak_a, std::abs(s.i_a_a), std::abs(s.i_b_a), std::abs(s.i_c_a)});
  });
  return {"AC-22",
          "its start from rest without load: to 95 and 99 % of the synchronous speed, overshoot, largest "
          "phase current",
          "an exercise; simulated 0.472 s, 0.4893 s, 127.079 rad/s, 16.69 A",
          {number("", at_95_s, "s"), number("", at_99_s, "s"), number("", peak_rad_s, "rad/s"),
           number("", peak_a, "A")},
          "agrees"};
}

}  // namespace

ResultSection steady_state_results() {
  return {"Induction motors on the line, steady state (chapter 7)",
          {no_load_and_locked(), pull_out(), loads(), power_split(), servo_circle(), largest_power(),
           line_start()}};
}

}  // namespace drivebench
