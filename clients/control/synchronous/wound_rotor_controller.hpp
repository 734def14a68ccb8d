#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/models/wound_rotor_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// Both kinds of current follow di/dt = ω_c·(e + ω_i·∫e).
struct WoundRotorCurrentGains {
  double bandwidth_per_s;      ///< ω_c
  double integral_rate_per_s;  ///< ω_i

  static constexpr std::tuple kGains{
      gain("bandwidth_per_s", &WoundRotorCurrentGains::bandwidth_per_s, GainRule::kPositive),
      gain("integral_rate_per_s", &WoundRotorCurrentGains::integral_rate_per_s, GainRule::kNotNegative)};
};

struct WoundRotorParameters {
  WoundRotorModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< of a phase
  double field_voltage_limit_v;
  double current_limit_a;   ///< of |i|, two-phase
  double field_current_a;   ///< up to the base speed
  double base_speed_rad_s;  ///< above it the field current goes down with 1/ω
  WoundRotorCurrentGains current;
  ServoGains position;
  SpeedObserverGains speed_observer;
  double angle_lead_samples = 0.5;  ///< the voltages are turned ahead by the angle of so many samples

  static constexpr std::tuple kGains{
      gains_in("machine.", &WoundRotorParameters::machine),
      gain("sample_rate_hz", &WoundRotorParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &WoundRotorParameters::counts_per_revolution, GainRule::kPositive),
      gain("voltage_limit_v", &WoundRotorParameters::voltage_limit_v, GainRule::kPositive),
      gain("field_voltage_limit_v", &WoundRotorParameters::field_voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &WoundRotorParameters::current_limit_a, GainRule::kPositive),
      gain("field_current_a", &WoundRotorParameters::field_current_a, GainRule::kPositive),
      gain("base_speed_rad_s", &WoundRotorParameters::base_speed_rad_s, GainRule::kPositive),
      gains_in("current.", &WoundRotorParameters::current),
      gains_in("position.", &WoundRotorParameters::position),
      gains_in("speed_observer.", &WoundRotorParameters::speed_observer),
      gain("angle_lead_samples", &WoundRotorParameters::angle_lead_samples, GainRule::kNotNegative)};
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Position control of a wound-rotor synchronous machine in the frame of its field, with a command for the
/// field:
///   i_F,ref = I_F·min(1, ω_b/|ω|)        i_d,ref = 0
///   i_q,ref = (J·(α_ref + K0·∫e + K1·e + K2·(ω_ref − ω)) + f·ω)/(n_p·M·i_F)        with e = θ_ref − θ
/// The currents are driven by the inverse of the machine's equations, so that stator and field do not meet:
/// the field and the d axis share most of their flux. A reference or a voltage at its limit freezes the
/// integrals. The field lies along phase a at count 0.
class WoundRotorController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit WoundRotorController(const WoundRotorParameters& p) noexcept;

 private:
  struct Currents {
    Dq stator;
    double field;
  };
  struct Voltages {
    Dq stator;
    double field;
  };
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  Currents references(const Reference& r, double i_field_a) noexcept;
  Voltages voltages(const Currents& i, const Currents& error) noexcept;

  WoundRotorParameters p_;
  ShaftSensing shaft_;
  ServoLoop position_;
  Currents integral_as_{};
  double last_torque_nm_ = 0.0;
  bool saturated_ = false;
};

}  // namespace drivebench::control
