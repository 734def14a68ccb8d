#pragma once

#include "plant/tick.hpp"

namespace drivebench {

/// A rigid shaft with viscous and Coulomb friction and stiction.
struct ShaftParameters {
  double inertia_kgm2 = 0.0;
  double viscous_friction_nms = 0.0;  ///< [N·m·s/rad]
  double coulomb_friction_nm = 0.0;   ///< opposes motion
  double static_friction_nm = 0.0;    ///< holds a shaft that stands; at least the Coulomb friction
};

/// Speed and angle of the shaft, positive from phase a to phase b.
struct ShaftState {
  double speed_rad_s = 0.0;
  double angle_rad = 0.0;  ///< within the present turn; the axis counts whole turns
};

/// Which branch of the friction law holds, constant between two events.
struct FrictionBranch {
  double turns = 1.0;      ///< 1: the shaft may turn, 0: stiction holds it
  double direction = 0.0;  ///< sign of the motion that Coulomb friction opposes
};

/// The branch for a shaft at this speed under this driving torque (machine minus load).
FrictionBranch friction_branch(const ShaftParameters& p, double speed_rad_s, double driving_nm) noexcept;

/// J w' = tau - tau_L - f w - tau_C sign(w). Motor torque and load torque have the signs of the book:
/// a positive load torque opposes a positive motor torque. Source: Chiasson 2005, (2.1), (9.104).
inline ShaftState derivative(const ShaftParameters& p, const ShaftState& x, double torque_nm, double load_nm,
                             const FrictionBranch& branch) noexcept {
  const double net_nm =
      torque_nm - load_nm - p.viscous_friction_nms * x.speed_rad_s - p.coulomb_friction_nm * branch.direction;
  // The reciprocal is the same in all stages of a step, so that the compiler divides once.
  return {.speed_rad_s = branch.turns * net_nm * (1.0 / p.inertia_kgm2), .angle_rad = x.speed_rad_s};
}

/// Load torque on the shaft: a constant, or on its way to one. Times are ticks.
class LoadTorque {
 public:
  /// Goes from the present value to target_nm in ramp_ticks (0: a step at this tick).
  void go_to(double target_nm, Tick tick, Tick ramp_ticks) noexcept;
  /// The torque that holds during this tick.
  double at(Tick tick) const noexcept;

 private:
  double start_nm_ = 0.0;
  double target_nm_ = 0.0;
  Tick start_tick_ = 0;
  Tick ramp_ticks_ = 0;
};

}  // namespace drivebench
