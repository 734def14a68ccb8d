#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clients/control/estimators/load_observers.hpp"
#include "clients/control/gains/gains.hpp"
#include "clients/control/loop/controller.hpp"
#include "clients/control/math/frames.hpp"
#include "clients/models/induction_motor.hpp"

namespace drivebench::control {

/// What the linearising controllers of an induction machine share: the machine, its encoder and amplifier,
/// and the observer that stands for speed and flux.
struct InductionDriveParameters {
  InductionMotorModel motor;
  double sample_rate_hz;
  double counts_per_revolution;
  double voltage_limit_v;  ///< per phase
  double current_limit_a;  ///< per phase, of the amplifier
  double quadrature_reference_limit_a;
  SpeedObserverGains speed_observer;

  static std::span<const GainRow<InductionDriveParameters>> gains() noexcept;
  std::vector<std::string> problems() const;

  constexpr double period_s() const noexcept { return 1.0 / sample_rate_hz; }
  /// Direct references stay this far inside the amplifier's limit.
  constexpr double direct_reference_limit_a() const noexcept { return 0.98 * current_limit_a; }
};

/// An induction machine as its controller sees it at a sample.
struct InductionState {
  double angle_rad = 0.0;  ///< measured, since the first sample
  double speed_rad_s = 0.0;
  double flux_wb = 0.0;
  double flux_angle_rad = 0.0;
  Direction flux{.cosine = 1.0, .sine = 0.0};
  DirectQuadrature current_a{.d = 0.0, .q = 0.0};

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

/// The same for machines under load, where a speed observer that knows no load is off by (l1/l2)·τ_L/J, 5
/// rad/s for the servo motor at 0.25 N·m, and turns the flux away: flux from the shaft angle (IMO-08), which
/// needs no speed, and speed from the load-torque observer (IMO-09) with three poles at load_pole_per_s.
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

}  // namespace drivebench::control
