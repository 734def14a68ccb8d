#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/flux_estimator.hpp"
#include "clients/control/estimators/observers.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/current_loop.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/models/induction_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

enum class QuadratureClip {
  kFixed,  ///< |i_q,ref| ≤ quadrature_reference_limit_a
  kCircular,  ///< |i_q,ref| ≤ √(I² − i_d,ref²): the mistake of treating a reference as if it were the current
};

/// The law of the position.
enum class PositionLaw {
  kServo,   ///< ServoGains around the reference
  kNested,  ///< NestedServoGains, which know the angle of the reference alone
};

/// A proportional position loop around a PI speed loop:
///   ω_want = K_θ·e + share·ω_ref, within ± the limit        α = K_P·(ω_want − ω̂) + K_I·∫(ω_want − ω̂)
/// The polynomial is s³ + (K_P + f/J)·s² + (K_I + K_P·K_θ)·s + K_I·K_θ. In a cruise it lags by (1 −
/// share)·ω/K_θ. Source: the book, figure 8.34 (exercise 17 of chapter 8, IMC-09); the share is ours.
struct NestedServoGains {
  double angle_proportional_per_s = 0.0;  ///< K_θ
  double speed_proportional_per_s = 0.0;  ///< K_P
  double speed_integral_per_s2 = 0.0;     ///< K_I
  double speed_share = 0.0;               ///< of ω_ref that is fed forward
  double speed_limit_rad_s = 0.0;

  static constexpr std::tuple kGains{
      gain("angle_proportional_per_s", &NestedServoGains::angle_proportional_per_s, GainRule::kNotNegative),
      gain("speed_proportional_per_s", &NestedServoGains::speed_proportional_per_s, GainRule::kNotNegative),
      gain("speed_integral_per_s2", &NestedServoGains::speed_integral_per_s2, GainRule::kNotNegative),
      gain("speed_share", &NestedServoGains::speed_share, GainRule::kNotNegative),
      gain("speed_limit_rad_s", &NestedServoGains::speed_limit_rad_s, GainRule::kNotNegative)};
};

struct ControllerParameters {
  InductionMachineModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< per phase
  double current_limit_a;  ///< per phase, of the amplifier
  double rated_direct_current_a;
  double quadrature_reference_limit_a;
  CurrentGains current;
  ServoGains position;
  FluxGains flux;
  SpeedObserverGains speed_observer;
  SpeedSource speed_source = SpeedSource::kObserver;
  QuadratureClip quadrature_clip = QuadratureClip::kFixed;
  FluxEstimatorParameters flux_observer{};
  PositionLaw law = PositionLaw::kServo;
  NestedServoGains nested{};  ///< of kNested

  static constexpr std::tuple kGains{
      gains_in("machine.", &ControllerParameters::machine),
      gain("sample_rate_hz", &ControllerParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &ControllerParameters::counts_per_revolution, GainRule::kPositive),
      gain("voltage_limit_v", &ControllerParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &ControllerParameters::current_limit_a, GainRule::kPositive),
      gain("rated_direct_current_a", &ControllerParameters::rated_direct_current_a, GainRule::kPositive),
      gain("quadrature_reference_limit_a", &ControllerParameters::quadrature_reference_limit_a,
           GainRule::kPositive),
      gains_in("current.", &ControllerParameters::current),
      gains_in("position.", &ControllerParameters::position),
      gains_in("flux.", &ControllerParameters::flux),
      gains_in("speed_observer.", &ControllerParameters::speed_observer),
      gains_in("flux_observer.", &ControllerParameters::flux_observer),
      gains_in("nested.", &ControllerParameters::nested)};
  /// Everything that is wrong, one sentence each; empty when a controller can be built.
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  /// ψ_d0 = M·i_d0, the flux that the rated direct current keeps up.
  constexpr double rated_flux_wb() const noexcept {
    return machine.mutual_inductance_h * rated_direct_current_a;
  }
};

/// The voltages for tick k and how they came about.
struct ControlOutput {
  double u_a_v = 0.0;
  double u_b_v = 0.0;
  bool voltage_saturated = false;
  bool references_clipped = false;
  double i_d_a = 0.0;
  double i_q_a = 0.0;
  double i_d_reference_a = 0.0;
  double i_q_reference_a = 0.0;
  double flux_estimate_wb = 0.0;
  double flux_angle_estimate_rad = 0.0;
  double speed_estimate_rad_s = 0.0;    ///< by the speed source in use
  double speed_observer_rad_s = 0.0;    ///< IMO-04, or IMO-10 with the flux; whichever is in use
  double speed_difference_rad_s = 0.0;  ///< IMO-03, whichever is in use
  double load_nm = 0.0;                 ///< IMO-10 alone
  double measured_angle_rad = 0.0;      ///< since the first sample
  double position_error_counts = 0.0;   ///< reference − measured angle
};

/// Field-oriented position control of an induction machine from encoder counts and two phase currents:
///   i_q,ref = (K0·∫e + K1·e + K2·(ω_ref − ω̂) + (f/J)·ω̂ + α_ref)/(μ·ψ_d0)         with e = θ_ref − θ
///   i_d,ref = K_ψP·(ψ_d0 − ψ̂) + K_ψI·∫(ψ_d0 − ψ̂) + i_d0
/// or the acceleration of NestedServoGains in place of that in the bracket,
/// followed by PI current loops in the frame of the estimated flux. Friction is fed forward with a plus sign
/// (the print has a minus). A reference at its clip freezes its own integrator; a voltage at its limit
/// freezes all of them. ψ̂ is the estimate of flux_observer; where that gives a speed too, it is the
/// observer's speed. Source: the book, (8.12), (8.19)-(8.21), (8.37), (8.40) (IMC-02, IMC-03, IMO-02,
/// IMO-04).
class FieldOrientedController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit FieldOrientedController(const ControllerParameters& p) noexcept;

  /// Of the last sample.
  const ControlOutput& output() const noexcept { return output_; }
  const ControllerParameters& parameters() const noexcept { return p_; }

 private:
  /// Over a gap the observers are carried along; the integrators count it as one period.
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  void carry_observers(std::int64_t periods) noexcept;
  double direct_reference(double flux_error_wb, bool& clipped) noexcept;
  double wanted_acceleration_rad_s2(const Reference& r, double angle_error_rad, double speed_rad_s) noexcept;
  double quadrature_reference(const Reference& r, double angle_error_rad, double speed_rad_s,
                              double i_d_reference_a, bool& clipped) noexcept;

  ControllerParameters p_;
  double rad_per_count_;
  double amperes_per_acceleration_;  // 1/(μ·ψ_d0)
  CurrentLoop current_loop_;
  FluxEstimator flux_;
  SpeedObserver speed_;
  BackwardDifference difference_;

  ControlOutput output_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
  double angle_integral_rad_s_ = 0.0;
  double nested_speed_error_rad_s_ = 0.0;
  double speed_integral_rad_ = 0.0;
  double flux_integral_wb_s_ = 0.0;
  // Of the last sample: what the observers are stepped with when the next one comes.
  Dq last_current_a_{.d = 0.0, .q = 0.0};
  TwoPhase last_voltage_v_{.a = 0.0, .b = 0.0};
  double last_angle_rad_ = 0.0;
  double last_speed_rad_s_ = 0.0;
};

}  // namespace drivebench::control
