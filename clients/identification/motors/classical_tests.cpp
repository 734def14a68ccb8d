#include "clients/identification/motors/classical_tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

#include "clients/identification/data/signals.hpp"
#include "plant/math/length.hpp"
#include "plant/math/phasor.hpp"
#include "plant/math/trig.hpp"

namespace drivebench::identification {
namespace {

using Impedance = std::complex<double>;

constexpr double kWidestInterval = 0.1;  ///< of a parameter that is stated

Impedance impedance_ohm(const MeterReading& m) {
  if (!(m.voltage_v > 0.0 && m.current_a > 0.0))
    throw IdentificationError("a test at the terminals needs voltage and current");
  return phasor(arctangent2(m.reactive_var, m.active_w), m.voltage_v / m.current_a);
}

double pulsation_rad_s(const MeterReading& m) {
  if (!(m.frequency_hz > 0.0)) throw IdentificationError("the frequency of a test must be positive");
  return 2.0 * std::numbers::pi * m.frequency_hz;
}

/// A reading with another impedance and the same current.
MeterReading with_impedance(MeterReading m, Impedance z) {
  const double apparent_va = length(m.active_w, m.reactive_var);
  const double old_ohm = m.voltage_v / m.current_a;
  m.voltage_v = magnitude(z) * m.current_a;
  m.active_w = apparent_va / old_ohm * z.real();
  m.reactive_var = apparent_va / old_ohm * z.imag();
  return m;
}

Estimate estimate(std::string name, std::string unit, double value, double interval) {
  return {
      .name = std::move(name), .unit = std::move(unit), .value = value, .truth = {}, .interval = interval};
}

/// Names the parameters whose noise is too large to be stated.
void judge_intervals(Result& result) {
  std::vector<std::string> wide;
  for (const Estimate& e : result.parameters) {
    if (!(e.interval.value_or(0.0) <= kWidestInterval * std::abs(e.value))) wide.push_back(e.name);
  }
  result.excitation.verdict = "the readings give every parameter";
  if (wide.empty()) return;
  add_unseen(result.excitation, wide,
             fmt::format("the noise leaves more than a tenth of {} open; record longer or with more current",
                         fmt::join(wide, ", ")));
}

constexpr std::array<const char*, 7> kNames = {"R_S", "T_R", "L_S", "sigma", "M", "L_R", "R_R"};
constexpr std::array<const char*, 7> kUnits = {"ohm", "s", "H", "1", "H", "H", "ohm"};

/// What the three tests read: R_S, no-load and blocked impedance.
struct Readings {
  double stator_resistance_ohm;
  MeterReading no_load;
  MeterReading blocked;
};

/// Half of the 95 % intervals of the parameters: each reading moved by its own, the changes added by squares.
std::array<double, 7> intervals_of(const Readings& at, const TerminalReading& dc, const TerminalReading& idle,
                                   const TerminalReading& held) {
  std::array<double, 7> squares{};
  const auto add = [&](const Readings& less, const Readings& more) {
    const TestedMotor low = tested_motor(less.stator_resistance_ohm, less.no_load, less.blocked);
    const TestedMotor high = tested_motor(more.stator_resistance_ohm, more.no_load, more.blocked);
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      const double half = 0.5 * (value_of(high, kNames[k]) - value_of(low, kNames[k]));
      squares[k] += half * half;
    }
  };
  // The derivative is taken over a part of the interval, so that a wide one stays where the motor exists.
  constexpr double kPart = 0.01;
  const Impedance no_load = impedance_ohm(at.no_load);
  const Impedance blocked = impedance_ohm(at.blocked);
  Readings less = at;
  Readings more = at;
  less.stator_resistance_ohm -= kPart * dc.real_interval_ohm;
  more.stator_resistance_ohm += kPart * dc.real_interval_ohm;
  add(less, more);
  const auto moved = [&](MeterReading Readings::*reading, Impedance z, Impedance step) {
    less = more = at;
    less.*reading = with_impedance(at.*reading, z - step);
    more.*reading = with_impedance(at.*reading, z + step);
    add(less, more);
  };
  moved(&Readings::no_load, no_load, {0.0, kPart * idle.imaginary_interval_ohm});
  moved(&Readings::blocked, blocked, {kPart * held.real_interval_ohm, 0.0});
  moved(&Readings::blocked, blocked, {0.0, kPart * held.imaginary_interval_ohm});
  for (double& square : squares)
    square = std::sqrt(square) / kPart;
  return squares;
}

}  // namespace

double dc_resistance_ohm(const MeterReading& reading) {
  return impedance_ohm(reading).real();
}

double no_load_inductance_h(const MeterReading& reading) {
  return impedance_ohm(reading).imag() / pulsation_rad_s(reading);
}

BlockedRotor blocked_rotor(const MeterReading& reading, double stator_resistance_ohm) {
  const Impedance z = impedance_ohm(reading);
  return {.rotor_resistance_ohm = z.real() - stator_resistance_ohm,
          .leakage_h = 0.5 * z.imag() / pulsation_rad_s(reading)};
}

TestedMotor tested_motor(double stator_resistance_ohm, const MeterReading& no_load,
                         const MeterReading& blocked) {
  const double stator_h = no_load_inductance_h(no_load);
  const BlockedRotor held = blocked_rotor(blocked, stator_resistance_ohm);
  const double mutual_h = stator_h - held.leakage_h;
  if (!(mutual_h > 0.0 && held.leakage_h > 0.0 && held.rotor_resistance_ohm > 0.0))
    throw IdentificationError(
        fmt::format("the readings are those of no motor: L_S = {:.4g} H without load, L_S - M = {:.4g} H and "
                    "R_R = {:.4g} "
                    "ohm with the rotor held; all of them and M must be positive",
                    stator_h, held.leakage_h, held.rotor_resistance_ohm));
  return {.stator_resistance_ohm = stator_resistance_ohm,
          .rotor_time_constant_s = stator_h / held.rotor_resistance_ohm,
          .stator_inductance_h = stator_h,
          .leakage_factor = 1.0 - mutual_h * mutual_h / (stator_h * stator_h),
          .mutual_inductance_h = mutual_h,
          .rotor_resistance_ohm = held.rotor_resistance_ohm};
}

std::optional<TestedMotor> motor_with_branch(double stator_resistance_ohm, const MeterReading& no_load,
                                             const MeterReading& blocked) {
  const double stator_h = no_load_inductance_h(no_load);
  const double omega = pulsation_rad_s(blocked);
  const Impedance y = (impedance_ohm(blocked) - stator_resistance_ohm) / Impedance(0.0, omega * stator_h);
  const double x = (1.0 - y.real()) / -y.imag();
  const double coupling = (1.0 - y.real()) * (1.0 + 1.0 / (x * x));
  if (!(x > 0.0 && coupling > 0.0 && coupling < 1.0)) return std::nullopt;
  return TestedMotor{.stator_resistance_ohm = stator_resistance_ohm,
                     .rotor_time_constant_s = x / omega,
                     .stator_inductance_h = stator_h,
                     .leakage_factor = 1.0 - coupling,
                     .mutual_inductance_h = stator_h * std::sqrt(coupling),
                     .rotor_resistance_ohm = stator_h * omega / x};
}

NoLoadLosses no_load_losses(const TerminalReading& no_load, double stator_resistance_ohm,
                            double resistance_interval_ohm, double leakage_factor) {
  const Impedance z = impedance_ohm(no_load.meter);
  const double squares = no_load.phases * no_load.meter.current_a * no_load.meter.current_a;
  const double coupling = 1.0 - leakage_factor;
  NoLoadLosses losses{.power_w = squares * (z.real() - stator_resistance_ohm),
                      .interval_w = squares * length(no_load.real_interval_ohm, resistance_interval_ohm)};
  // sigma t x^2 - (1 - sigma) x + t = 0, of which the smaller x is the run without load.
  const double t = std::max(0.0, z.real() - stator_resistance_ohm) / z.imag();
  const double root = std::sqrt(std::max(0.0, coupling * coupling - 4.0 * leakage_factor * t * t));
  const double x = 2.0 * t / (coupling + root);
  losses.slip_angle = x;
  losses.inductance_bias = -coupling * x * x / (1.0 + x * x);
  return losses;
}

Result dc_resistance_test(const TerminalReading& dc) {
  Result result = {.kind = "induction", .method = "resistance with DC"};
  result.parameters = {estimate("R_S", "ohm", dc_resistance_ohm(dc.meter), dc.real_interval_ohm)};
  judge_intervals(result);
  return result;
}

Result no_load_test(const TerminalReading& no_load) {
  Result result = {.kind = "induction", .method = "no-load test"};
  const double omega = pulsation_rad_s(no_load.meter);
  result.parameters = {
      estimate("L_S", "H", no_load_inductance_h(no_load.meter), no_load.imaginary_interval_ohm / omega)};
  judge_intervals(result);
  return result;
}

Result blocked_rotor_test(const TerminalReading& blocked, std::optional<double> stator_resistance_ohm) {
  Result result = {.kind = "induction", .method = "blocked-rotor test"};
  const BlockedRotor held = blocked_rotor(blocked.meter, stator_resistance_ohm.value_or(0.0));
  const double omega = pulsation_rad_s(blocked.meter);
  result.parameters = {estimate(stator_resistance_ohm ? "R_R" : "R_S+R_R", "ohm", held.rotor_resistance_ohm,
                                blocked.real_interval_ohm),
                       estimate("L_S-M", "H", held.leakage_h, 0.5 * blocked.imaginary_interval_ohm / omega)};
  judge_intervals(result);
  return result;
}

ClassicalTests classical_tests(const TerminalReading& dc, const TerminalReading& no_load,
                               const TerminalReading& blocked) {
  const Readings readings = {dc_resistance_ohm(dc.meter), no_load.meter, blocked.meter};
  const TestedMotor motor = tested_motor(readings.stator_resistance_ohm, readings.no_load, readings.blocked);
  const std::array<double, 7> intervals = intervals_of(readings, dc, no_load, blocked);
  ClassicalTests tests{
      .result = {.kind = "induction", .method = "DC resistance, no-load and blocked-rotor test"},
      .with_branch = motor_with_branch(readings.stator_resistance_ohm, readings.no_load, readings.blocked),
      .losses = no_load_losses(no_load, readings.stator_resistance_ohm, dc.real_interval_ohm,
                               motor.leakage_factor)};
  for (std::size_t k = 0; k < kNames.size(); ++k)
    tests.result.parameters.push_back(
        estimate(kNames[k], kUnits[k], value_of(motor, kNames[k]), intervals[k]));
  judge_intervals(tests.result);
  return tests;
}

double value_of(const TestedMotor& motor, std::string_view name) noexcept {
  if (name == "R_S") return motor.stator_resistance_ohm;
  if (name == "T_R") return motor.rotor_time_constant_s;
  if (name == "L_S" || name == "L_R") return motor.stator_inductance_h;
  if (name == "sigma") return motor.leakage_factor;
  if (name == "M") return motor.mutual_inductance_h;
  return name == "R_R" ? motor.rotor_resistance_ohm : 0.0;
}

Result standstill_step(const MeasuredData& data, const std::string& current, const std::string& voltage) {
  const SeriesView i = data.at(current);
  const SeriesView u = data.at(voltage);
  const Series slope = central_difference(i, data.period_s);
  Regression fit({"R", "L"});
  for (std::size_t k = 1; k + 1 < i.size(); ++k)
    fit.add(std::array{0.25 * (i[k - 1] + 2.0 * i[k] + i[k + 1]), slope[k]}, 0.5 * (u[k] + u[k + 1]));
  const LeastSquares found = fit.solve();
  Result result = {.kind = "winding", .method = "step of a winding at standstill"};
  result.parameters = {{"R", "ohm", found.estimate[0], found.index_double[0], {}},
                       {"L", "H", found.estimate[1], found.index_double[1], {}}};
  result.error_index = found.error_index;
  result.condition = found.condition;
  result.samples = fit.rows();
  result.excitation = found.excitation;
  return result;
}

}  // namespace drivebench::identification
