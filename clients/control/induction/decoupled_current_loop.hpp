#pragma once

#include "clients/control/induction/induction_drive.hpp"
#include "clients/control/loop/current_loop.hpp"

namespace drivebench::control {

/// The voltages that bring these rates of both currents about, by undoing what couples them:
///   u_d = σ·L_S·(γ·i_d − η·β·ψ − n_p·ω·i_q − η·M·i_q²/ψ + di_d/dt)
///   u_q = σ·L_S·(γ·i_q + β·n_p·ω·ψ + n_p·ω·i_d + η·M·i_d·i_q/ψ + di_q/dt)
/// Source: Chiasson 2005, (8.10), (8.11) (IMC-01), which the text says nobody uses.
DirectQuadrature decoupled_voltage_v(const InductionMotorModel& motor, const InductionState& x,
                                     DirectQuadrature current_rate_a_s) noexcept;

/// The phase voltages, each within the limit, turned half a period ahead since they are held while the flux
/// moves on.
PhaseCommand held_voltage(const InductionDriveParameters& drive, const InductionState& x,
                          DirectQuadrature voltage_v) noexcept;

/// Currents of first order: di/dt = di_ref/dt + p·(i_ref − i) on both axes, by decoupled_voltage_v(). A law
/// with an integrator before a current takes that current for its state, so the current must be there; PI
/// loops without decoupling are not enough.
class DecoupledCurrentLoop {
 public:
  DecoupledCurrentLoop(const InductionDriveParameters& drive, double pole_per_s) noexcept
      : drive_(drive), pole_per_s_(pole_per_s) {}

  PhaseCommand step(const InductionState& x, DirectQuadrature reference_a,
                    DirectQuadrature reference_rate_a_s) const noexcept;

 private:
  InductionDriveParameters drive_;
  double pole_per_s_;
};

}  // namespace drivebench::control
