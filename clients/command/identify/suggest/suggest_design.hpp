#pragma once

#include <bench.pb.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/identification/math/pattern_search.hpp"
#include "clients/identification/motors/motors.hpp"

namespace drivebench::command {

/// What an experiment must not exceed.
struct ExperimentLimits {
  double current_a = 0.0;    ///< of a phase or the armature
  double voltage_v = 0.0;    ///< the same
  double speed_rad_s = 0.0;  ///< 0: no limit
  double duration_s = 0.0;
};

/// A family of experiments: what may change, and how it is put into a request.
struct ExperimentDesign {
  std::string sentence;                                   ///< for the reader of the file
  std::vector<identification::SearchVariable> variables;  ///< amplitudes, each with its frequency; instants
  std::function<void(const std::vector<double>&, v1::RunExperiment&)> excite;
};

/// The smallest amplitudes and the highest frequencies of a family: the least current and speed that it has.
std::vector<double> gentlest(const ExperimentDesign& design);

/// The family that suits this kind of motor on this drive ("source", "voltage_amplifier"):
///   im on a source: starts with one amplitude and frequency and goes on with another; with an amplifier: the
///   same as three phases; dc: two sines of the voltage; pm, bldc: two sines of u_q and one of u_d, which
///   turn with the motor.
/// Amplitudes and frequencies stay within the limits, half of the sample rate and the duration.
ExperimentDesign design_for(const identification::MotorName& motor, std::string_view drive,
                            const identification::BenchParameters& bench, const ExperimentLimits& limits,
                            double period_s);

}  // namespace drivebench::command
