#include "clients/identification/motors/classical_tests.hpp"

#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "clients/identification/data/signals.hpp"

namespace drivebench::identification {
namespace {

std::complex<double> impedance_ohm(const MeterReading& m) {
  if (!(m.voltage_v > 0.0 && m.current_a > 0.0))
    throw IdentificationError("a test at the terminals needs voltage and current");
  return std::polar(m.voltage_v / m.current_a, std::atan2(m.reactive_var, m.active_w));
}

double pulsation_rad_s(double frequency_hz) {
  if (!(frequency_hz > 0.0)) throw IdentificationError("the frequency of a test must be positive");
  return 2.0 * std::numbers::pi * frequency_hz;
}

}  // namespace

double dc_resistance_ohm(double terminal_voltage_v, double current_a) {
  if (current_a == 0.0) throw IdentificationError("no current flows: the resistance cannot be told");
  return 0.5 * terminal_voltage_v / current_a;
}

double no_load_inductance_h(const MeterReading& reading, double frequency_hz) {
  return impedance_ohm(reading).imag() / pulsation_rad_s(frequency_hz);
}

BlockedRotor blocked_rotor(const MeterReading& reading, double frequency_hz, double stator_resistance_ohm) {
  const std::complex<double> z = impedance_ohm(reading);
  return {.rotor_resistance_ohm = z.real() - stator_resistance_ohm,
          .leakage_h = 0.5 * z.imag() / pulsation_rad_s(frequency_hz)};
}

Result classical_induction_tests(double stator_resistance_ohm, const MeterReading& no_load,
                                 const MeterReading& blocked, double frequency_hz) {
  const double stator_h = no_load_inductance_h(no_load, frequency_hz);
  const BlockedRotor held = blocked_rotor(blocked, frequency_hz, stator_resistance_ohm);
  const double mutual_h = stator_h - held.leakage_h;
  if (!(mutual_h > 0.0 && held.leakage_h > 0.0 && held.rotor_resistance_ohm > 0.0))
    throw IdentificationError("no-load and blocked-rotor readings do not fit together");
  Result result = {.kind = "induction", .method = "DC resistance, no-load and blocked-rotor test"};
  result.parameters = {{"R_S", "ohm", stator_resistance_ohm, 0.0, {}},
                       {"T_R", "s", stator_h / held.rotor_resistance_ohm, 0.0, {}},
                       {"L_S", "H", stator_h, 0.0, {}},
                       {"sigma", "1", 1.0 - mutual_h * mutual_h / (stator_h * stator_h), 0.0, {}},
                       {"M", "H", mutual_h, 0.0, {}},
                       {"L_R", "H", stator_h, 0.0, {}},
                       {"R_R", "ohm", held.rotor_resistance_ohm, 0.0, {}}};
  result.samples = 2;
  result.excitation.verdict = "the tests give every parameter";
  result.notes = {"R_R is too small by about (M/L_R)^2: the blocked test leaves out the magnetising branch."};
  return result;
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
