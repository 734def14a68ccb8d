#pragma once

#include "plant/machines/pm_dc/pm_dc_machine.hpp"

namespace drivebench {

/// A bar that slides on two rails across a magnetic field. It moves along a line: what is called angle,
/// speed, torque and inertia elsewhere is its position [m], speed [m/s], force [N] and mass [kg]; 1 rad is 1
/// m.
struct LinearDcMachineParameters {
  double resistance_ohm = 0.0;  ///< R of the loop
  double inductance_h = 0.0;    ///< L of the loop, which the book neglects
  double flux_density_t = 0.0;  ///< B across the rails
  double bar_length_m = 0.0;    ///< l between the rails
};

/// The equations are those of pm_dc, with K = B l [N/A]:
///   L i' = u - R i - B l v, and B l i is the force on the bar.
/// The book has L = 0; the currents of both differ for some L/R after a change only. The inductance does not
/// grow with the loop. Source: the book, section 1.2. The parameters must be free of problems().
PmDcMachineConstants constants_of(const LinearDcMachineParameters& p) noexcept;

Connection connection_of(const LinearDcMachineParameters& p) noexcept;
/// 0: the equations do not know the position.
double pole_pairs_of(const LinearDcMachineParameters& p) noexcept;
LinearDcMachineParameters adjusted(const LinearDcMachineParameters& p, const Adjustment& a) noexcept;
/// L/R: sets the substep.
double fastest_time_constant_s(const LinearDcMachineParameters& p) noexcept;

/// Names the parts of the machine for the templates of plant/train/drive_train.hpp.
struct LinearDcMachine {
  using Parameters = LinearDcMachineParameters;
  using Constants = PmDcMachineConstants;
  using State = PmDcMachineState;
  static constexpr bool kUsesAngle = false;
  static constexpr bool kHasCorners = false;
  static MachineKind kind() noexcept;
};

}  // namespace drivebench
