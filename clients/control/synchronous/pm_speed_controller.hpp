#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "clients/control/estimators/shaft_sensing.hpp"
#include "clients/control/gains/gains.hpp"
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
  VectorCurrentGains current;
  SpeedObserverGains speed_observer;
  double angle_lead_samples = 0.5;  ///< the voltages are turned ahead by the angle of so many samples

  static std::span<const GainRow<PmSpeedParameters>> gains() noexcept;
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
/// lies along phase a at count 0. Source: Chiasson 2005, 9.2 and problem 9.8 (PMT-06).
class PmSpeedController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit PmSpeedController(const PmSpeedParameters& p);

  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept override;

  Quantity quantity() const noexcept override { return Quantity::kVoltage; }
  double angle_rad() const noexcept override { return shaft_.angle_rad(); }
  double speed_rad_s() const noexcept override { return shaft_.speed_rad_s(); }
  bool saturated() const noexcept override { return current_loop_.saturated(); }
  std::span<const std::string_view> telemetry_names() const noexcept override;
  std::span<const double> telemetry() const noexcept override { return telemetry_; }

 private:
  DirectQuadrature wanted_current_a(const Reference& r) const noexcept;

  PmSpeedParameters p_;
  ShaftSensing shaft_;
  PmTorqueTable table_;
  VectorCurrentLoop current_loop_;
  double last_i_q_a_ = 0.0;
  std::array<double, 6> telemetry_{};
};

}  // namespace drivebench::control
