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
  std::complex<double> open_v;    ///< rms, against the source's phase
  std::complex<double> line_ohm;  ///< of the secondary side
  InductionCircuit motor;         ///< with the transformer's impedance in its stator, on |open_v|

  std::complex<double> terminal_v(double slip) const {
    return open_v - line_ohm * motor.at(slip).stator_a * std::polar(1.0, std::arg(open_v));
  }
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
  result.line_ohm = secondary + n * n * primary * magnetising / (primary + magnetising);
  result.motor = {.motor = motor,
                  .star = true,
                  .voltage_v = std::abs(result.open_v),
                  .frequency_hz = p.drive.source.frequency_hz};
  result.motor.motor.stator_resistance_ohm += result.line_ohm.real();
  result.motor.motor.stator_inductance_h += result.line_ohm.imag() / omega;
  return result;
}

}  // namespace drivebench
