#pragma once

#include <array>
#include <optional>
#include <string>

#include "clients/identification/data/measured_data.hpp"
#include "clients/identification/data/result.hpp"
#include "clients/identification/motors/terminal_reading.hpp"

namespace drivebench::identification {

/// R_S = U/I of a reading with DC, whichever of the phases carry it. Throws IdentificationError without
/// voltage or current.
double dc_resistance_ohm(const MeterReading& reading);

/// L_S = Im Z/w of a motor that turns with the field. Source: the book, problem 7.19; tag P3-09.
double no_load_inductance_h(const MeterReading& reading);

/// R_R = Re Z - R_S and sigma_S M = Im Z/(2 w) of a motor that is held: the magnetising branch counts as
/// open, which makes R_R too small by about the factor (M/L_R)^2.
struct BlockedRotor {
  double rotor_resistance_ohm = 0.0;
  double leakage_h = 0.0;
};
BlockedRotor blocked_rotor(const MeterReading& reading, double stator_resistance_ohm);

/// A motor with equal leakages, L_R = L_S, as the tests give it.
struct TestedMotor {
  double stator_resistance_ohm = 0.0;
  double rotor_time_constant_s = 0.0;
  double stator_inductance_h = 0.0;
  double leakage_factor = 0.0;
  double mutual_inductance_h = 0.0;
  double rotor_resistance_ohm = 0.0;
};

/// The motor by the book's way: M = L_S - sigma_S M, sigma = 1 - M^2/L_S^2, T_R = L_S/R_R. Throws
/// IdentificationError if the readings are those of no motor.
TestedMotor tested_motor(double stator_resistance_ohm, const MeterReading& no_load,
                         const MeterReading& blocked);

/// The motor from the same readings with the magnetising branch left in. With L_S of the no-load test the
/// held rotor has (Z - R_S)/(j w L_S) = sigma + (1 - sigma)/(1 + j w T_R), which is solved for sigma and T_R.
/// Nothing if no motor has these readings. The no-load test still counts as one without slip.
std::optional<TestedMotor> motor_with_branch(double stator_resistance_ohm, const MeterReading& no_load,
                                             const MeterReading& blocked);

/// What the no-load test takes beside the stator's copper: friction and, of a real motor, iron.
struct NoLoadLosses {
  double power_w = 0.0;
  double interval_w = 0.0;  ///< half of the 95 % interval
  /// If friction takes all of it, the slip times w T_R at which the rotor carries it: x of
  /// (Re Z - R_S)/Im Z = (1 - sigma) x/(1 + sigma x^2).
  double slip_angle = 0.0;
  double inductance_bias = 0.0;  ///< of L_S for that slip, relative: -(1 - sigma) x^2/(1 + x^2)
};
NoLoadLosses no_load_losses(const TerminalReading& no_load, double stator_resistance_ohm,
                            double resistance_interval_ohm, double leakage_factor);

// ---- each test as a result with 95 % intervals; a parameter whose interval is wider than a tenth is unseen

Result dc_resistance_test(const TerminalReading& dc);
Result no_load_test(const TerminalReading& no_load);
/// R_R and L_S - M; R_S + R_R in the place of R_R if R_S is not known. `leakage` is L_S - M.
Result blocked_rotor_test(const TerminalReading& blocked, std::optional<double> stator_resistance_ohm);

/// The three tests together: R_S, T_R, L_S, sigma, M, L_R, R_R by the book's way. The intervals cover the
/// noise of the readings and not what the way neglects, which `with_branch` shows.
struct ClassicalTests {
  Result result;
  std::optional<TestedMotor> with_branch;
  NoLoadLosses losses;
};
ClassicalTests classical_tests(const TerminalReading& dc, const TerminalReading& no_load,
                               const TerminalReading& blocked);

/// The parameter of this name (R_S, T_R, L_S, sigma, M, L_R, R_R) of a tested motor; 0 for any other.
double value_of(const TestedMotor& motor, std::string_view name) noexcept;

/// R and L of a winding that stands still, from current and voltage after a step: L i' + R i = u by least
/// squares, each term as its mean over two periods, so that an edge of the voltage does not matter. `current`
/// and `voltage` name the columns; the voltage is the mean of the period before its sample. Any machine whose
/// rotor is held in the axis of the winding.
Result standstill_step(const MeasuredData& data, const std::string& current, const std::string& voltage);

}  // namespace drivebench::identification
