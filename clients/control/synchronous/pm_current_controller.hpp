#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/models/pm_machine.hpp"

namespace drivebench::control {

struct PmCurrentParameters {
  PmMachineModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< of |u|, two-phase: what i_d has to leave the current amplifier
  double current_limit_a;  ///< of |i|, two-phase
  ServoGains position;
  SpeedObserverGains speed_observer;
  double angle_lead_samples = 0.5;  ///< the currents are turned ahead by the angle of so many samples

  static constexpr std::tuple kGains{
      gains_in("machine.", &PmCurrentParameters::machine),
      gain("sample_rate_hz", &PmCurrentParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &PmCurrentParameters::counts_per_revolution, GainRule::kPositive),
      gains_in("speed_observer.", &PmCurrentParameters::speed_observer),
      gain("angle_lead_samples", &PmCurrentParameters::angle_lead_samples, GainRule::kNotNegative),
      gain("voltage_limit_v", &PmCurrentParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &PmCurrentParameters::current_limit_a, GainRule::kPositive),
      gains_in("position.", &PmCurrentParameters::position)};
  std::vector<std::string> problems() const { return range_problems(*this); }

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Position control of a PM synchronous machine behind a current amplifier, which takes care of the voltages:
///   i_q,ref = (J·(α_ref + K0·∫e + K1·e + K2·(ω_ref − ω)) + f·ω_ref)/K_m        with e = θ_ref − θ
/// and i_d,ref the one closest to zero with which i_q takes no more than the voltage limit at ω_ref: the
/// optimal lead angle of a stepping motor would make a machine of few pole pairs carry more i_d than i_q. A
/// current amplifier that lags by an electrical angle puts i_q into i_d, so n_p must be small. Where |i|
/// would be above its limit i_q is shortened and the integral stands still. The magnet lies along phase a at
/// count 0. Source: the book, (9.49)-(9.52) (PMC-04).
class PmCurrentController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit PmCurrentController(const PmCurrentParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;

  PmCurrentParameters p_;
  ShaftSensing shaft_;
  ServoLoop position_;
  double last_i_q_a_ = 0.0;
};

}  // namespace drivebench::control
