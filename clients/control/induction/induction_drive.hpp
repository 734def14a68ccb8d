#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <vector>

#include "clients/control/estimators/load_observers.hpp"
#include "clients/control/gains/machine_gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/loop/current_loop.hpp"
#include "clients/models/induction_machine.hpp"
#include "plant/math/frames.hpp"

namespace drivebench::control {

/// The common parameters of the linearising controllers of an induction machine: the machine, its encoder and
/// amplifier, and the observer that stands for speed and flux.
struct InductionDriveParameters {
  InductionMotorModel motor;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< per phase
  double current_limit_a;  ///< per phase, of the amplifier
  double quadrature_reference_limit_a;
  SpeedObserverGains speed_observer;

  static constexpr std::tuple kGains{
      gains_in("machine.", &InductionDriveParameters::motor),
      gain("sample_rate_hz", &InductionDriveParameters::sample_rate_hz, GainRule::kPositive),
      gain("counts_per_revolution", &InductionDriveParameters::counts_per_revolution, GainRule::kPositive),
      gain("voltage_limit_v", &InductionDriveParameters::voltage_limit_v, GainRule::kPositive),
      gain("current_limit_a", &InductionDriveParameters::current_limit_a, GainRule::kPositive),
      gain("quadrature_reference_limit_a", &InductionDriveParameters::quadrature_reference_limit_a,
           GainRule::kPositive),
      gains_in("speed_observer.", &InductionDriveParameters::speed_observer)};
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  /// Direct references stay this far inside the amplifier's limit.
  constexpr double direct_reference_limit_a() const noexcept { return 0.98 * current_limit_a; }
};

/// The state of an induction machine in its controller at a sample.
struct InductionState {
  double angle_rad = 0.0;  ///< measured, since the first sample
  double speed_rad_s = 0.0;
  double flux_wb = 0.0;
  double flux_angle_rad = 0.0;
  CosSin flux{.cos = 1.0, .sin = 0.0};
  Dq current_a{.d = 0.0, .q = 0.0};

  /// For divisions: an unmagnetised machine has no torque to reckon with.
  double flux_divisor_wb() const noexcept { return flux_wb > 1e-3 ? flux_wb : 1e-3; }
};

/// From counts and phase currents to the state along the rotor flux, by the coupled observer (IMO-05).
/// Samples that were lost are bridged with the currents of the last one.
class InductionFeedback {
 public:
  explicit InductionFeedback(const InductionDriveParameters& p) noexcept;

  const InductionState& sample(const Measurement& m, std::int64_t periods) noexcept;
  const InductionState& state() const noexcept { return state_; }

 private:
  double rad_per_count_;
  double period_s_;
  CoupledObserver observer_;
  InductionState state_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
};

/// The same for machines under load, where a speed observer without a load is off by (l1/l2)·τ_L/J, 5 rad/s
/// for the servo motor at 0.25 N·m, and turns the flux away: flux from the shaft angle (IMO-08), which needs
/// no speed, and speed from the load-torque observer (IMO-09) with three poles at load_pole_per_s.
class LoadedInductionFeedback {
 public:
  LoadedInductionFeedback(const InductionDriveParameters& p, double load_pole_per_s) noexcept;

  const InductionState& sample(const Measurement& m, std::int64_t periods) noexcept;
  const InductionState& state() const noexcept { return state_; }
  double load_nm() const noexcept { return motion_.load_nm(); }

 private:
  double rad_per_count_;
  double period_s_;
  double acceleration_per_wb_a_;  // μ
  PositionFluxObserver flux_;
  LoadTorqueObserver motion_;
  InductionState state_;
  bool started_ = false;
  std::int64_t start_count_ = 0;
};

/// x within ±limit; notes when that took something off.
double clipped(double x, double limit, bool& at_limit) noexcept;

/// The voltages that bring these rates of both currents about, by undoing what couples them:
///   u_d = σ·L_S·(γ·i_d − η·β·ψ − n_p·ω·i_q − η·M·i_q²/ψ + di_d/dt)
///   u_q = σ·L_S·(γ·i_q + β·n_p·ω·ψ + n_p·ω·i_d + η·M·i_d·i_q/ψ + di_q/dt)
/// Source: the book, (8.10), (8.11) (IMC-01), which practice does without, as the text says.
Dq decoupled_voltage_v(const InductionMotorModel& motor, const InductionState& x,
                       Dq current_rate_a_s) noexcept;

/// The phase voltages, each within the limit, turned half a period ahead since they are held while the flux
/// moves on.
PhaseVoltages held_voltage(const InductionDriveParameters& drive, const InductionState& x,
                           Dq voltage_v) noexcept;

/// Currents of first order: di/dt = di_ref/dt + p·(i_ref − i) on both axes, by decoupled_voltage_v(). A law
/// with an integrator before a current takes that current for its state, so the current must be there; PI
/// loops without decoupling are not enough.
class DecoupledCurrentLoop {
 public:
  DecoupledCurrentLoop(const InductionDriveParameters& drive, double pole_per_s) noexcept
      : drive_(drive), pole_per_s_(pole_per_s) {}

  PhaseVoltages step(const InductionState& x, Dq reference_a, Dq reference_rate_a_s) const noexcept;

 private:
  InductionDriveParameters drive_;
  double pole_per_s_;
};

}  // namespace drivebench::control
