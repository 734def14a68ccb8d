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

  static std::span<const GainRow<PmCurrentParameters>> gains() noexcept;
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
};

/// Position control of a PM synchronous machine behind a current amplifier, which takes care of the voltages:
///   i_q,ref = (J·(α_ref + K0·∫e + K1·e + K2·(ω_ref − ω)) + f·ω_ref)/K_m        with e = θ_ref − θ
/// and i_d,ref the one closest to zero with which i_q takes no more than the voltage limit at ω_ref: the
/// optimal lead angle of a stepping motor would make a machine of few pole pairs carry more i_d than i_q. A
/// current amplifier that lags by an electrical angle puts i_q into i_d, so n_p must be small. Where |i|
/// would be above its limit i_q is shortened and the integral stands still. The magnet lies along phase a at
/// count 0. Source: Chiasson 2005, (9.49)-(9.52) (PMC-04).
class PmCurrentController final : public Controller {
 public:
  /// `p` must have no problems().
  explicit PmCurrentController(const PmCurrentParameters& p) noexcept;

  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept override;

  Quantity quantity() const noexcept override { return Quantity::kCurrent; }
  double angle_rad() const noexcept override { return shaft_.angle_rad(); }
  double speed_rad_s() const noexcept override { return shaft_.speed_rad_s(); }
  bool saturated() const noexcept override { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept override;
  std::span<const double> telemetry() const noexcept override { return telemetry_; }

 private:
  PmCurrentParameters p_;
  ShaftSensing shaft_;
  ServoLoop position_;
  double last_i_q_a_ = 0.0;
  bool saturated_ = false;
  std::array<double, 4> telemetry_{};
};

}  // namespace drivebench::control
