#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/observers.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

enum class StepMode {
  kFull,   ///< one phase on: a quarter of an electrical turn a step
  kHalf,   ///< one and two phases on in turn: an eighth; with two on the torque is √2 times that of one
  kMicro,  ///< cosine and sine
};

struct StepperParameters {
  double pole_pairs;  ///< teeth of the rotor, usually 50
  double sample_rate_hz;
  double counts_per_revolution;
  double amplitude;         ///< of a phase, in volts or amperes
  double microsteps = 1.0;  ///< in a full step, with kMicro
  StepMode mode = StepMode::kFull;
  Quantity drive = Quantity::kVoltage;

  static constexpr std::tuple kGains{
      gain("machine.pole_pairs", &StepperParameters::pole_pairs, GainRule::kPositive),
      gain("sample_rate_hz", &StepperParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &StepperParameters::counts_per_revolution, GainRule::kPositive),
      gain("amplitude", &StepperParameters::amplitude, GainRule::kPositive),
      gain("microsteps", &StepperParameters::microsteps, GainRule::kPositive)};
  std::vector<std::string> problems() const;

  /// The angle of one step: 360°/(4·n_p) for a full one.
  double step_rad() const noexcept;
};

/// The phase values, for an amplitude of 1, at which the rotor of a stepping motor rests at an electrical
/// angle; the angle is rounded to the nearest step. Source: the book, 9.4 and problem 9.10 (ST-01,
/// ST-03).
TwoPhase step_pattern(StepMode mode, double microsteps, double electrical_rad) noexcept;

/// A stepping motor without feedback: the phases are those at which the rotor rests at the angle of the
/// reference, rounded to the nearest step. Angle 0 is the full step closest to where the rotor stands at the
/// first sample. The encoder is only looked at.
class StepperController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit StepperController(const StepperParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  StepperParameters p_;
  BackwardDifference difference_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
  double start_electrical_rad_ = 0.0;
};

}  // namespace drivebench::control
