#pragma once

#include <array>
#include <optional>

#include "clients/control/gains/move_allowance.hpp"
#include "clients/control/induction/flux_reference.hpp"
#include "clients/control/math/limits.hpp"
#include "clients/control/moves/trajectory.hpp"
#include "clients/models/induction_machine.hpp"

namespace drivebench::control {

/// The currents and voltages of a machine that follows a reference: i_d,ref from the flux reference, i_q,ref
/// from the acceleration and friction, and the voltages of both,
///   u_d = R_S·i_d − σ·L_S·ω_S·i_q + (M/L_R)·dψ/dt     u_q = R_S·i_q + σ·L_S·ω_S·i_d + (M/L_R)·ω_S·ψ
/// with ω_S = n_p·ω + η·M·i_q/ψ. Lengths of the two-phase vectors; the voltage across σ·L_S that changes the
/// currents themselves is left out, since references may step. Source: the book, (8.9).
class InductionDemands {
 public:
  InductionDemands(const InductionMotorModel& motor, const MoveAllowance& allowance) noexcept
      : motor_(motor), allowance_(allowance) {}

  std::array<Demand, 2> at(const Reference& r, const FluxTarget& flux) const noexcept;

 private:
  InductionMotorModel motor_;
  MoveAllowance allowance_;
};

/// first_exceeded() of a move with this flux reference, which is stepped every period_s from the start.
std::optional<Exceeded> first_exceeded(const Trajectory& move, FluxReference flux, double period_s,
                                       const InductionDemands& demands);

}  // namespace drivebench::control
