#pragma once

#include <cmath>
#include <complex>
#include <numbers>

#include "clients/models/induction_circuit.hpp"
#include "plant/axis_parameters.hpp"

namespace drivebench {

/// The induction motor of an axis behind its transformer, as phasors of one phase: Thévenin's voltage and
/// impedance of the circuit of 7.4.3, worked out from its elements and not from the plant's equations.
struct TransformerCircuit {
  std::complex<double> open_v;  ///< rms, against the source's phase
  InductionCircuit motor;       ///< on |open_v|, with the impedance in its line
};

inline TransformerCircuit transformer_circuit(const AxisParameters& p, const InductionMotorModel& motor) {
  using Complex = std::complex<double>;
  const TransformerParameters& t = p.drive.transformer;
  const double omega = 2.0 * std::numbers::pi * p.drive.source.frequency_hz;
  const Complex primary(t.primary_resistance_ohm, omega * t.primary_leakage_h);
  const Complex magnetising(0.0, omega * t.magnetising_inductance_h);
  const Complex secondary(t.secondary_resistance_ohm, omega * t.secondary_leakage_h);
  const double n = t.turns_ratio;
  TransformerCircuit result;
  result.open_v = n * p.drive.source.amplitude_v / std::sqrt(2.0) * magnetising / (primary + magnetising);
  const Complex line_ohm = secondary + n * n * primary * magnetising / (primary + magnetising);
  result.motor = {.motor = motor,
                  .star = true,
                  .voltage_v = std::abs(result.open_v),
                  .frequency_hz = p.drive.source.frequency_hz,
                  .line_resistance_ohm = line_ohm.real(),
                  .line_inductance_h = line_ohm.imag() / omega};
  return result;
}

}  // namespace drivebench
