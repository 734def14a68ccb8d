#pragma once

#include <optional>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "clients/control/estimators/flux_observers.hpp"
#include "clients/control/gains/gains.hpp"

namespace drivebench::control {

/// The source of a controller's rotor flux.
enum class FluxSource {
  kPolar,            ///< PolarFluxObserver (IMO-02)
  kEulerCopy,        ///< StationaryFluxObserver by forward Euler (IMO-01, IMO-07)
  kExactCopy,        ///< the same as an exponential
  kVergheseSanders,  ///< VergheseSandersObserver (IMO-06)
  kMartinRouchon,    ///< MartinRouchonObserver (IMO-11)
  kRotorFrame,       ///< RotorFrameObserver, which gives speed and load as well (IMO-10)
};

struct FluxEstimatorParameters {
  FluxSource source = FluxSource::kPolar;
  double start_wb = 0.0;               ///< the estimate before the first sample, along phase a
  double stator_resistance_ohm = 0.0;  ///< of the observers that use the voltage, kVergheseSanders and
  double stator_inductance_h = 0.0;    ///< kMartinRouchon
  double correction = 0.0;             ///< k of kVergheseSanders
  double first_rate_per_h = 0.0;  ///< r1 and r2 of kMartinRouchon: its error decays at R_R·r1 and R_R·r2
  double second_rate_per_h = 0.0;
  double load_pole_per_s = 0.0;  ///< three of the load observer of kRotorFrame

  static constexpr std::tuple kGains{
      gain("start_wb", &FluxEstimatorParameters::start_wb, GainRule::kNotNegative),
      gain("stator_resistance_ohm", &FluxEstimatorParameters::stator_resistance_ohm, GainRule::kNotNegative),
      gain("stator_inductance_h", &FluxEstimatorParameters::stator_inductance_h, GainRule::kNotNegative),
      gain("correction", &FluxEstimatorParameters::correction, GainRule::kNotNegative),
      gain("first_rate_per_h", &FluxEstimatorParameters::first_rate_per_h, GainRule::kNotNegative),
      gain("second_rate_per_h", &FluxEstimatorParameters::second_rate_per_h, GainRule::kNotNegative),
      gain("load_pole_per_s", &FluxEstimatorParameters::load_pole_per_s, GainRule::kNotNegative)};
  /// What the chosen observer lacks or cannot bear, with `prefix` before the names of the gains.
  std::vector<std::string> problems(const std::string& prefix, const InductionMachineModel& machine,
                                    double period_s) const;
};

/// Magnitude and angle of the rotor flux by the observer of the parameters, in two halves: step() carries it
/// over a period with what was in force then, sample() completes it with what the next sample measured. The
/// voltage is the one commanded, so the bench must not delay it (command_delay_ticks = 0).
class FluxEstimator {
 public:
  /// `p` must have no problems().
  FluxEstimator(const InductionMachineModel& machine, const FluxEstimatorParameters& p,
                double period_s) noexcept;

  double magnitude_wb() const noexcept { return magnitude_wb_; }
  double angle_rad() const noexcept { return angle_rad_; }  ///< in (−π, π]
  /// Of the observers that give them.
  struct Motion {
    double speed_rad_s;
    double load_nm;
  };
  std::optional<Motion> motion() const noexcept;

  /// Held over the period that begins.
  struct Held {
    Dq current_a;  ///< along the estimate
    TwoPhase voltage_v;
    double speed_rad_s;
    double shaft_angle_rad;
  };
  void step(const Held& held) noexcept;
  void sample(TwoPhase current_a, double shaft_angle_rad) noexcept;

 private:
  using Observer = std::variant<PolarFluxObserver, StationaryFluxObserver, VergheseSandersObserver,
                                MartinRouchonObserver, RotorFrameObserver>;
  static Observer observer_of(const InductionMachineModel& machine, const FluxEstimatorParameters& p,
                              double period_s) noexcept;

  Observer observer_;
  double period_s_;
  double magnitude_wb_ = 0.0;
  double angle_rad_ = 0.0;
};

}  // namespace drivebench::control
