#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/vector_current_loop.hpp"
#include "clients/control/synchronous/optimum_torque_pm.hpp"
#include "clients/models/pm_machine.hpp"

namespace drivebench::control {

struct PmSpeedParameters {
  PmMachineModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;   ///< of |u|, two-phase
  double current_limit_a;   ///< of |i|, two-phase
  double speed_gain_per_s;  ///< acceleration wanted for an error of the speed
  double max_speed_rad_s;   ///< up to which the torque table reaches
  CurrentGains current;
  SpeedObserverGains speed_observer;
  double angle_lead_samples = 0.5;  ///< the voltages are turned ahead by the angle of so many samples

  static constexpr std::tuple kGains{
      gains_in("machine.", &PmSpeedParameters::machine),
      gain("sample_rate_hz", &PmSpeedParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &PmSpeedParameters::counts_per_revolution, GainRule::kPositive),
      gains_in("speed_observer.", &PmSpeedParameters::speed_observer),
      gain("angle_lead_samples", &PmSpeedParameters::angle_lead_samples, GainRule::kNotNegative),
      gain("voltage_limit_v", &PmSpeedParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &PmSpeedParameters::current_limit_a, GainRule::kPositive),
      gain("speed_gain_per_s", &PmSpeedParameters::speed_gain_per_s, GainRule::kPositive),
      gain("max_speed_rad_s", &PmSpeedParameters::max_speed_rad_s, GainRule::kPositive),
      gains_in("current.", &PmSpeedParameters::current)};
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  constexpr PmLimits limits() const noexcept {
    return {.voltage_v = voltage_limit_v, .current_a = current_limit_a};
  }
};

/// Speed control of a PM synchronous machine that goes to the limits of voltage and current and not beyond:
///   i_q,ref = (J·K·(ω_ref − ω) + J·α_ref + f·ω)/K_m,  at most that of the largest torque at this speed
///   i_d,ref = that of the largest torque there, else the one closest to zero that the voltage allows
/// followed by PI current loops with decoupling, u_ff = (−n_p·ω·L_S·i_q, n_p·ω·L_S·i_d + K_m·ω). The magnet
/// lies along phase a at count 0. Source: the book, 9.2 and problem 9.8 (PMT-06).
class PmSpeedController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit PmSpeedController(const PmSpeedParameters& p);

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  Dq wanted_current_a(const Reference& r) const noexcept;

  PmSpeedParameters p_;
  ShaftSensing shaft_;
  PmTorqueTable table_;
  VectorCurrentLoop current_loop_;
  double last_i_q_a_ = 0.0;
};

}  // namespace drivebench::control
