#pragma once

#include <string>

#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/data/result.hpp"

namespace drivebench::identification {

/// The reading of a power analyser on a symmetric star: rms per phase, active and reactive power of all three
/// phases.
struct MeterReading {
  double voltage_v = 0.0;
  double current_a = 0.0;
  double active_w = 0.0;
  double reactive_var = 0.0;
};

/// R_S from voltage and current at the terminals of two phases in series, with DC.
double dc_resistance_ohm(double terminal_voltage_v, double current_a);

/// L_S = Im Z/w of a motor that turns with the field. Source: the book, problem 7.19; tag P3-09.
double no_load_inductance_h(const MeterReading& reading, double frequency_hz);

/// R_R = Re Z - R_S and sigma_S M = Im Z/(2 w) of a motor that is held: the magnetising branch counts as
/// open, which makes R_R too small by about the factor (M/L_R)^2.
struct BlockedRotor {
  double rotor_resistance_ohm = 0.0;
  double leakage_h = 0.0;
};
BlockedRotor blocked_rotor(const MeterReading& reading, double frequency_hz, double stator_resistance_ohm);

/// The three tests together: R_S, L_S, R_R, M = L_S - sigma_S M, L_R = L_S, sigma = 1 - M^2/L_S^2, T_R =
/// L_R/R_R.
Result classical_induction_tests(double stator_resistance_ohm, const MeterReading& no_load,
                                 const MeterReading& blocked, double frequency_hz);

/// R and L of a winding that stands still, from current and voltage after a step: L i' + R i = u by least
/// squares, each term as its mean over two periods, so that an edge of the voltage does not matter. `current`
/// and `voltage` name the columns; the voltage is the mean of the period before its sample. Any machine whose
/// rotor is held in the axis of the winding.
Result standstill_step(const MeasuredData& data, const std::string& current, const std::string& voltage);

}  // namespace drivebench::identification
