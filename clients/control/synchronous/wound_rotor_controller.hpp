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
#include "clients/control/math/frames.hpp"

namespace drivebench::control {

/// What the controller believes about a synchronous machine with a field winding, in the frame of the field,
/// two phases or the two-phase equivalent of a star:
///   u_d = R_S·i_d + L_S·di_d/dt + M·di_F/dt − n_p·ω·L_S·i_q
///   u_q = R_S·i_q + L_S·di_q/dt + n_p·ω·(L_S·i_d + M·i_F)
///   u_F = R_F·i_F + L_F·di_F/dt + M·di_d/dt
///   J·dω/dt = n_p·M·i_F·i_q − f·ω − τ_L
/// Source: Chiasson 2005, (6.38) and problem 6.14, whose print lacks n_p in the torque (SM-01, SM-03).
struct WoundRotorModel {
  double pole_pairs;
  double stator_resistance_ohm;
  double stator_inductance_h;
  double field_resistance_ohm;
  double field_inductance_h;
  double mutual_inductance_h;
  double friction_nms;  ///< viscous, f [N·m·s/rad]
  double inertia_kgm2;
  bool star = false;

  constexpr double friction_rate_per_s() const noexcept { return friction_nms / inertia_kgm2; }
};

/// Both kinds of current follow di/dt = ω_c·(e + ω_i·∫e).
struct WoundRotorCurrentGains {
  double bandwidth_per_s;      ///< ω_c
  double integral_rate_per_s;  ///< ω_i
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

  static std::span<const GainRow<WoundRotorParameters>> gains() noexcept;
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

  Setpoint update(const Measurement& m, const Reference& r, std::int64_t periods = 1) noexcept override;

  Quantity quantity() const noexcept override { return Quantity::kVoltage; }
  double angle_rad() const noexcept override { return shaft_.angle_rad(); }
  double speed_rad_s() const noexcept override { return shaft_.speed_rad_s(); }
  bool saturated() const noexcept override { return saturated_; }
  std::span<const std::string_view> telemetry_names() const noexcept override;
  std::span<const double> telemetry() const noexcept override { return telemetry_; }

 private:
  struct Currents {
    DirectQuadrature stator;
    double field;
  };
  struct Voltages {
    DirectQuadrature stator;
    double field;
  };
  Currents references(const Reference& r, double i_field_a) noexcept;
  Voltages voltages(const Currents& i, const Currents& error) noexcept;

  WoundRotorParameters p_;
  ShaftSensing shaft_;
  ServoLoop position_;
  Currents integral_as_{};
  double last_torque_nm_ = 0.0;
  bool saturated_ = false;
  std::array<double, 6> telemetry_{};
};

}  // namespace drivebench::control
