#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/servo_loop.hpp"
#include "clients/control/salient/least_current.hpp"
#include "clients/models/salient_pm_machine.hpp"

namespace drivebench::control {

/// Where the direct current of a salient machine comes from.
enum class SalientCurrent {
  kLeast,       ///< least_current()
  kQuadrature,  ///< i_d = 0: the torque of the saliency is given away
};

struct SalientPmParameters {
  SalientPmModel machine;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;    ///< of |u|, two-phase
  double current_limit_a;    ///< of |i|, two-phase
  double torque_pole_per_s;  ///< p, of the torque and of i_d
  ServoGains position;
  SpeedObserverGains speed_observer;
  SalientCurrent current = SalientCurrent::kLeast;

  static constexpr std::tuple kGains{
      gains_in("machine.", &SalientPmParameters::machine),
      gain("sample_rate_hz", &SalientPmParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &SalientPmParameters::counts_per_revolution, GainRule::kPositive),
      gains_in("speed_observer.", &SalientPmParameters::speed_observer),
      gain("voltage_limit_v", &SalientPmParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &SalientPmParameters::current_limit_a, GainRule::kPositive),
      gain("torque_pole_per_s", &SalientPmParameters::torque_pole_per_s, GainRule::kPositive),
      gains_in("position.", &SalientPmParameters::position)};
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Torque and its rate from the acceleration and jerk of a reference, and the currents for them.
struct SalientReferences {
  double torque_nm;
  double torque_nm_per_s;
  LeastCurrent least;
};

/// τ = J·α + f·ω of a point of the trajectory, and its currents.
SalientReferences salient_references(const SalientPmParameters& p, const Reference& r) noexcept;
/// The voltages of those currents, with both slopes.
Dq salient_voltage_v(const SalientPmModel& m, const SalientReferences& x, double speed_rad_s) noexcept;

/// Position control of a salient PM machine by input-output linearisation of torque and direct current:
///   τ_ref = J·(α_ref + K0·∫e + K1·e + K2·(ω_ref − ω̂)) + f·ω_ref        e = θ_ref − θ
///   di_d/dt = di_d,ref/dt + p·(i_d,ref − i_d)        dτ/dt = dτ_ref/dt + p·(τ_ref − τ)
///   di_q/dt = (τ'/n_p − δ·i_q·di_d/dt)/(λ + δ·i_d)        δ = L_d − L_q
/// with i_d,ref the least current for τ_ref, and the voltages of both slopes. Singular at i_d = −λ/δ, which
/// that curve never comes near. Voltages are turned half a sample ahead. |i| is bounded by the torque of
/// current_limit_a, |u| is shortened to its limit; at either the integral stands still. The magnet lies along
/// phase a at count 0. Source: the book, problem 9.11 (ST-06), whose decoupling matrix is
/// corrected.
class SalientPmController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit SalientPmController(const SalientPmParameters& p) noexcept;

 private:
  Setpoint step(const Measurement& m, const Reference& r, std::int64_t periods) noexcept override;
  /// The voltages that bring currents and torque towards the reference.
  Dq wanted_voltage_v(Dq i, double torque_nm, const SalientReferences& to) const noexcept;

  SalientPmParameters p_;
  double most_torque_nm_;
  ShaftSensing shaft_;
  ServoLoop position_;
  double last_torque_nm_ = 0.0;
};

}  // namespace drivebench::control
