#pragma once

#include <string>
#include <vector>

#include "clients/identification/data/settings.hpp"

namespace drivebench::identification {

/// A measured signal and the same signal of the identified motor at the measured voltages.
struct Resimulated {
  std::string name;  ///< i_a_a, i_b_a, i_c_a or speed_rad_s
  std::string unit;
  Series measured;
  Series simulated;
  double rms_error = 0.0;   ///< of the difference
  double normalised = 0.0;  ///< rms_error over the rms of the measured signal about its mean; not finite if
                            ///< that is zero
};

/// The validation of an identification over the samples of the equations.
struct Resimulation {
  double start_s = 0.0;  ///< of the first sample, from the record's first one on
  double period_s = 0.0;
  bool from_rest = false;  ///< the run began with the record, at standstill and without currents
  std::vector<Resimulated> signals;

  double time_s(std::size_t sample) const noexcept {
    return start_s + period_s * static_cast<double>(sample);
  }
};

/// Runs the motor with the estimated parameters on the measured voltages, with Runge-Kutta steps of a fifth
/// of its fastest time constant at most, and puts its currents and speed beside the measured ones. From the
/// beginning of the record if the motor stands there without currents, else from the window's first sample
/// with the state that the signals show. Nothing else is measured, except that the angle of a PM or brushless
/// motor, which turns its frame or commutates it, is the measured one: its voltages were made for that angle.
/// Throws IdentificationError if an estimate is no value for a motor or the run leaves all bounds.
Resimulation resimulate(const MeasuredData& data, const Settings& settings, const Result& result);

}  // namespace drivebench::identification
